#pragma once

#include "figure.hpp"

namespace subworld {

/// The image of a figure: four rays a pixel, each crossed with the solids whose ball covers its place. One light casts
/// shadows, by a map of the depths that it sees.
[[nodiscard]] Image render(const Figure& figure, PictureSize size);

}  // namespace subworld

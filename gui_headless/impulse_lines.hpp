#pragma once

#include "figure.hpp"

namespace subworld {

/// Adds to `figure` one line for every border body of every user, from its centre along the sum of the border impulses
/// on it (paper, figure 13). Sets the scale of the lines. Needs the figure's camera and origin.
void add_impulse_lines(const Picture& picture, PictureSize size, Figure& figure);

}  // namespace subworld

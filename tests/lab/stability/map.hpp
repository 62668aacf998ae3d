#pragma once

#include "lab/page/tables.hpp"

#include <string>

namespace subworld {

/// A matrix as an SVG element: a line for each case and value, a column for each engine, preset and step. Each cell has
/// the measured value, coloured by error over tolerance. `all` decides the columns; `rows` are drawn.
[[nodiscard]] std::string stability_map(const Rows& all, const Rows& rows);
/// The legend of the colours, as an SVG element.
[[nodiscard]] std::string stability_legend();

}  // namespace subworld

#pragma once

#include <cstddef>
#include <tuple>
#include <vector>

namespace subworld::test {

/// Cells of a grid, row after row.
template <class Cell>
struct Halves {
  std::vector<Cell> half;   ///< for the short tests: every second cell, as on a chessboard
  std::vector<Cell> other;  ///< for an instantiation whose prefix begins with `Full`
};

template <class Cell>
Halves<Cell> halves(const std::vector<Cell>& grid, std::size_t columns) {
  Halves<Cell> found;
  for (std::size_t i = 0; i < grid.size(); ++i)
    ((i / columns + i % columns) % 2 == 0 ? found.half : found.other).push_back(grid[i]);
  return found;
}

/// The grid of two axes: a row for each value of the first one.
template <class A, class B>
Halves<std::tuple<A, B>> halves(const std::vector<A>& rows, const std::vector<B>& columns) {
  std::vector<std::tuple<A, B>> grid;
  for (const A& row : rows) {
    for (const B& column : columns) grid.emplace_back(row, column);
  }
  return halves(grid, columns.size());
}

/// Every fourth cell in `half`, all others in `other`: for tests that take seconds each.
template <class Cell>
Halves<Cell> quarter(Halves<Cell> grid) {
  Halves<Cell> found = halves(grid.half, 1);
  found.other.insert(found.other.end(), grid.other.begin(), grid.other.end());
  return found;
}

}  // namespace subworld::test

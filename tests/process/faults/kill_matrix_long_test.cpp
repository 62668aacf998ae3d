// The table of deploy/README.md: which exit code and which verdict follow a signal to a program of a run. For all
// cells: build/release/bin/kill_matrix_test --gtest_also_run_disabled_tests
#include "process/faults/kill_matrix.hpp"

#include <algorithm>

namespace subworld::test {
namespace {

/// Without those of kill_matrix_test. The signals that ask a program to end take one path: one of them is enough.
std::vector<KillCell> more_cells() {
  std::vector<KillCell> cells = kill_cells();
  const std::vector<KillCell> some = some_cells();
  std::erase_if(cells, [&](const KillCell& cell) {
    const auto is_it = [&](const KillCell& one) {
      return one.program == cell.program && one.signal == cell.signal && one.column == cell.column;
    };
    return cell.signal == "SIGINT" || cell.signal == "SIGHUP" || std::ranges::any_of(some, is_it);
  });
  return cells;
}
INSTANTIATE_TEST_SUITE_P(More, KillMatrix, ::testing::ValuesIn(more_cells()), name_of_cell);
INSTANTIATE_TEST_SUITE_P(DISABLED_All, KillMatrix, ::testing::ValuesIn(kill_cells()), name_of_cell);

}  // namespace
}  // namespace subworld::test

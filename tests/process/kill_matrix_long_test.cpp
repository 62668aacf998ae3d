// All cells of the table of deploy/README.md: which exit code and which verdict follow a signal to a program of a run.
#include "process/kill_matrix.hpp"

namespace subworld::test {
namespace {

INSTANTIATE_TEST_SUITE_P(All, KillMatrix, ::testing::ValuesIn(kill_cells()), name_of_cell);

}  // namespace
}  // namespace subworld::test

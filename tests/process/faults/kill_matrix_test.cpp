// Of the table of deploy/README.md a part of the cells; kill_matrix_long_test has all.
#include "process/faults/kill_matrix.hpp"

namespace subworld::test {
namespace {

TEST(KillTableTest, HasEachCellAndNoOther) {
  const KillTable table;
  for (const KillCell& cell : kill_cells())
    EXPECT_TRUE(table.at(cell)) << cell.program << ", " << cell.signal << ", " << cell.column;
  EXPECT_EQ(table.size(), kill_cells().size());
}

INSTANTIATE_TEST_SUITE_P(Some, KillMatrix, ::testing::ValuesIn(some_cells()), name_of_cell);

}  // namespace
}  // namespace subworld::test

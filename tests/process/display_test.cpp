#include "process/process_test.hpp"
#include "support/png_reader.hpp"

namespace subworld::test {
namespace {

class DisplayRun : public ProcessTest, public ::testing::WithParamInterface<std::string> {};

/// The proxy is red, the members of the sub-world are blue.
TEST_P(DisplayRun, LeavesAPictureOfTheSubWorld) {
  const Ended ended = run(scene("row"), {"--duration", "0.3", "--gui", "--dds", GetParam()});
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Image image = read_png(out() + "/picture.png");
  int red = 0, blue = 0;
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      const std::uint8_t* p = image.pixel(column, row);
      red += p[0] > 2 * p[1] && p[0] > 2 * p[2] && p[0] > 80;
      blue += 2 * p[2] > 3 * p[0] && p[2] > p[1] && p[2] > 80;
    }
  }
  EXPECT_GT(red, 50);
  EXPECT_GT(blue, 500);
}

INSTANTIATE_TEST_SUITE_P(Vendors, DisplayRun, ::testing::Values("mixed"), [](const auto& one) { return one.param; });

}  // namespace
}  // namespace subworld::test

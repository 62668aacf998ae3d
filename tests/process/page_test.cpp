#include "process/process_test.hpp"

#include <memory>
#include <regex>

namespace subworld::test {
namespace {

using Page = ProcessTest;

/// The page of a run in a real browser: it draws, its orders work, and it outlives the display.
TEST_F(Page, ShowsAndControlsARun) {
  constexpr int kSkipped = 77;
  Process run(run_words(scene("heap"), {"--mode", "realtime", "--duration", "1000", "--page"}), folder_.path());
  const std::regex named("page: (http://127\\.0\\.0\\.1:\\d+/)");
  std::smatch found;
  std::string text;
  ASSERT_TRUE(eventually([&] {
    text = run.out();
    return std::regex_search(text, found, named);
  })) << run.err();
  const TemporaryFolder folder;
  Process viewer(
      {"/usr/bin/python3", std::string(SOURCE_FOLDER) + "/tests/support/page_client/page_client.py", found[1], out()},
      folder.path());
  const int code = viewer.wait(280.0).value_or(-1);
  if (code == kSkipped) GTEST_SKIP() << viewer.out();
  EXPECT_EQ(code, 0) << viewer.err();
  EXPECT_EQ(run.wait().value_or(-1), 0) << run.err();  // the page has stopped it
}

}  // namespace
}  // namespace subworld::test

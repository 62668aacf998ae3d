#include "process/process_test.hpp"

#include <cmath>
#include <regex>
#include <sstream>

namespace subworld::test {
namespace {

constexpr int kNotShown = 77;

class Touch : public ProcessTest {
 protected:
  /// A person in a browser touches the scene press. Returns the exit code of their part, with its text.
  Ended touch() const {
    std::filesystem::remove_all(out());
    Process run(run_words(scene("press"), {"--device", "browser"}), folder_.path());
    const std::regex named("page: (http://127\\.0\\.0\\.1:\\d+/)");
    std::smatch found;
    std::string text;
    EXPECT_TRUE(eventually([&] {
      text = run.out();
      return std::regex_search(text, found, named);
    })) << run.err();
    const TemporaryFolder folder;
    Process page({"/usr/bin/python3", std::string(SOURCE_FOLDER) + "/tests/support/page_client/touch_client.py",
                  found.str(1), folder.path()},
                 folder.path());
    const int code = page.wait(150.0).value_or(-1);
    if (code != 0) run.signal(SIGINT);
    EXPECT_EQ(run.wait().value_or(-1), 0) << run.err();  // the page has stopped it
    return {code, page.out(), page.err()};
  }
};

constexpr double kBegins_s = 0.7;  // in the second run
constexpr std::size_t kPart = 20;  // milliseconds that a straight part of the path takes

/// Position and force along x of each millisecond, from where the tool is first at 5 mm, or from a moment on.
struct Pressed {
  std::vector<double> x_m, force_n;
};

Pressed pressed_in(const std::string& file, double from_s = 0.0) {
  const Table table = read_table(file);
  const std::size_t x = table.column("x_m"), force = table.column("force_x_n");
  Pressed all;
  for (const auto& row : table.rows) {
    if (all.x_m.empty() && (from_s > 0.0 ? row[0] < from_s - 5e-4 : row[x] < 0.005)) continue;
    all.x_m.push_back(row[x]);
    all.force_n.push_back(row[force]);
  }
  return all;
}

/// Until the tool is back.
std::size_t length_of(const Pressed& all) {
  std::size_t i = 0;
  while (i < all.x_m.size() && all.x_m[i] > 0.004) ++i;
  return i;
}

// A mouse in a real browser has the force that another device has on the same way.
TEST_F(Touch, ByAMouseInABrowserHasTheForceOfTheSameMotion) {
  int absences = 0;
  for (int tries = 0; tries < 3 && absences != 1; ++tries) {
    const Ended touched = touch();
    if (touched.code == kNotShown) GTEST_SKIP() << touched.out;
    ASSERT_EQ(touched.code, 0) << touched.err;
    absences = summary()["device"][0]["driver"]["absences"];
  }
  // Each absence but that after the last release is a browser that had no core for 0.25 s.
  if (absences != 1) GTEST_SKIP() << "this machine halts the browser: the tool was absent " << absences << " times";
  const Pressed touched = pressed_in(out() + "/device_0.csv");
  const std::size_t length = length_of(touched);
  ASSERT_GT(length, 500U);
  EXPECT_LT(*std::min_element(touched.force_n.begin(), touched.force_n.end()), -12.0);

  // The same way by an emulated device, in lock-step.
  std::string scene_text = read_text(scene("press"));
  const std::size_t path = scene_text.find("        - {move");
  ASSERT_NE(path, std::string::npos);
  std::ostringstream moves;
  moves << "        - {move: [" << touched.x_m.front() << ", 0, 0], during_s: [0.2, " << kBegins_s << "]}\n";
  for (std::size_t i = kPart; i < length; i += kPart) {
    const double to_s = kBegins_s + 1e-3 * static_cast<double>(i);
    moves << "        - {move: [" << touched.x_m[i] - touched.x_m[i - kPart] << ", 0, 0], during_s: ["
          << to_s - 1e-3 * kPart << ", " << to_s << "]}\n";
  }
  const std::string duration_s = std::to_string(kBegins_s + 1e-3 * static_cast<double>(length) + 0.1);
  const Ended again = run(folder_.write("press.yaml", scene_text.substr(0, path) + moves.str()),
                          {"--mode", "lockstep", "--duration", duration_s});
  ASSERT_EQ(again.code, 0) << again.err;
  const Pressed replayed = pressed_in(out() + "/device_0.csv", kBegins_s);
  ASSERT_GE(replayed.force_n.size(), length);
  double square = 0.0, difference = 0.0;
  for (std::size_t i = 0; i < length; ++i) {
    square += std::pow(touched.force_n[i], 2);
    difference += std::pow(touched.force_n[i] - replayed.force_n[i], 2);
  }
  RecordProperty("force_error_percent", std::to_string(100.0 * std::sqrt(difference / square)));
  EXPECT_LT(std::sqrt(difference / square), 0.05);
}

}  // namespace
}  // namespace subworld::test

#include "process/process_test.hpp"

#include <cmath>
#include <regex>
#include <sstream>

namespace subworld::test {
namespace {

constexpr int kNotShown = 77;

class Touch : public ProcessTest {
 protected:
  /// A person in a browser touches the scene press, as a script has it. Returns the exit code of their part, with its
  /// text.
  Ended touch(const std::string& script) const {
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
    Process page({"/usr/bin/python3", std::string(SOURCE_FOLDER) + "/tests/support/page_client/" + script, found.str(1),
                  folder.path()},
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
  // Each absence but that after the last release is a browser that had no core for 0.25 s.
  int absences = 0, missed = 0;
  for (int tries = 0; tries < 2 && (absences != 1 || missed > 5); ++tries) {
    const Ended touched = touch("touch_client.py");
    if (touched.code == kNotShown) FAIL() << touched.out;
    ASSERT_EQ(touched.code, 0) << touched.err << read_text(out() + "/logs/gui_headless.log");
    absences = summary()["device"][0]["driver"]["absences"];
    missed = summary()["haptic"][0]["missed_deadlines"];
  }
  if (absences != 1 || missed > 5)
    GTEST_SKIP() << "this machine is too busy: the tool was absent " << absences << " times, and " << missed
                 << " haptic steps were late";
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

// On a phone, below a sub-path of a proxy: nothing is covered, and the force that is shown is the operator's.
TEST_F(Touch, OnAPhoneBehindAProxyShowsTheOperatorsForce) {
  const Ended touched = touch("phone_client.py");
  if (touched.code == kNotShown) FAIL() << touched.out;
  EXPECT_EQ(touched.code, 0) << touched.err;
}

// The device follows a SpaceMouse that the browser has, and never jumps, also where it is unplugged while it is
// deflected.
TEST_F(Touch, ByASpaceMouseMovesAndTurnsTheTool) {
  const Ended touched = touch("space_mouse_client.py");
  if (touched.code == kNotShown) FAIL() << touched.out;
  ASSERT_EQ(touched.code, 0) << touched.err;
  const Table device = read_table(out() + "/device_0.csv");
  for (const char* name : {"x_m", "y_m", "z_m", "qx", "qy", "qz"}) {
    const std::size_t column = device.column(name);
    double least = 0.0, most = 0.0;
    for (const auto& row : device.rows) {
      least = std::min(least, row[column]);
      most = std::max(most, row[column]);
    }
    EXPECT_GT(most - least, 0.01) << name;
  }
  EXPECT_EQ(summary()["haptic"][0]["device_jumps"], 0);
  EXPECT_EQ(summary()["device"][0]["driver"]["refused"], 0);
}

/// Rows of a history within a span of simulated time, without its begin.
Table within(const Table& table, double from_s, double to_s) {
  Table part{.columns = table.columns, .rows = {}};
  for (const auto& row : table.rows)
    if (row[0] > from_s + 1e-6 && row[0] < to_s + 1e-6) part.rows.push_back(row);
  return part;
}

double sum_of(const Table& table, const std::string& name) {
  const std::size_t column = table.column(name);
  double sum = 0.0;
  for (const auto& row : table.rows) sum += row[column];
  return sum;
}

/// What a device does whose page sends no pose until a moment, s of simulated time.
struct PoseAbsence {
  double moved_s = 0.0;                  // the tool, for the last time
  double begins_s = 0.0, ends_s = 0.0;   // without force
  double before_n = 0.0, after_n = 0.0;  // largest force of the half second before, and of all time after
};

PoseAbsence absence_of(const Table& device, double until_s) {
  constexpr double kMoves_m_s = 0.02;
  const std::size_t force = device.column("force_x_n"), speed = device.column("velocity_y_m_s");
  const auto& rows = device.rows;
  const auto has_force = [&](std::size_t i) {
    return std::hypot(rows[i][force], rows[i][force + 1], rows[i][force + 2]) > 0.0;
  };
  std::size_t at = 0;
  while (at + 1 < rows.size() && rows[at][0] < until_s) ++at;
  std::size_t begin = at, end = at;
  while (begin > 0 && !has_force(begin)) --begin;
  while (end + 1 < rows.size() && !has_force(end)) ++end;
  PoseAbsence absence{.begins_s = rows[begin][0], .ends_s = rows[end][0]};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double size_n = std::abs(rows[i][force]);
    if (i <= begin && std::abs(rows[i][speed]) > kMoves_m_s) absence.moved_s = rows[i][0];
    if (i <= begin && rows[i][0] > absence.begins_s - 0.5) absence.before_n = std::max(absence.before_n, size_n);
    if (i >= end) absence.after_n = std::max(absence.after_n, size_n);
  }
  return absence;
}

/// What the loops did in a span of simulated time.
struct Loops {
  double steps = 0.0, skipped = 0.0, cycles = 0.0;  // skipped: of the haptic periods
  double real_time_factor = 0.0;                    // mean
};

Loops loops_of(const std::string& out, double from_s, double to_s) {
  const Table haptic = within(read_table(out + "/haptic_0.csv"), from_s, to_s);
  const Table world = within(read_table(out + "/world.csv"), from_s, to_s);
  const auto cycles = static_cast<double>(world.rows.size());
  return {static_cast<double>(haptic.rows.size()), sum_of(haptic, "skipped"), cycles,
          sum_of(world, "real_time_factor") / cycles};
}

/// Own steps or cycles that were too slow.
bool missed_by_the_run(const Json& gates) {
  return std::ranges::any_of(
      gates, [](const Json& gate) { return !gate["ok"] && gate.value("missed_by", std::string()) == "run"; });
}

// A browser whose renderers are halted for 3 s while their operator presses the cube.
TEST_F(Touch, ByATabThatStandsStillHasNoForceAndDelaysNoLoop) {
  constexpr double kMost = 0.02;  // of the periods
  double halted_s = 0.0, resumed_s = 0.0, steps = 0.0;
  Loops loops;
  const auto disturbed = [&] {
    return loops.skipped > kMost * steps || loops.real_time_factor < 1.0 - kMost ||
           missed_by_the_run(summary()["gates"]);
  };
  // Where other programs take the cores, a loop is late: then another try decides.
  for (int tries = 0; tries < 3 && (tries == 0 || disturbed()); ++tries) {
    const Ended touched = touch("slow_tab_client.py");
    if (touched.code == kNotShown) FAIL() << touched.out;
    ASSERT_EQ(touched.code, 0) << touched.err;
    const Json times = Json::parse(touched.out);
    halted_s = times["halted_s"];
    resumed_s = times["resumed_s"];
    steps = (resumed_s - halted_s) / summary()["h_s"].get<double>();
    loops = loops_of(out(), halted_s, resumed_s);
  }
  // Both loops have done their steps meanwhile, in real time.
  EXPECT_NEAR(loops.steps, steps, kMost * steps);
  EXPECT_LE(loops.skipped, kMost * steps);
  EXPECT_NEAR(loops.cycles, steps / summary()["ratio"].get<double>(), 1.5);
  EXPECT_GE(loops.real_time_factor, 1.0 - kMost);
  EXPECT_FALSE(missed_by_the_run(summary()["gates"])) << summary()["gates"].dump(1);
  EXPECT_EQ(summary()["verdict"].get<std::string>().find("unstable"), std::string::npos) << summary()["verdict"];

  // The force ends because poses are missing, and returns with them.
  constexpr double kWatchdog_s = 0.25, kSettles_s = 0.15;  // BrowserTool, PoseTracking
  const PoseAbsence absence = absence_of(read_table(out() + "/device_0.csv"), resumed_s);
  EXPECT_GT(absence.before_n, 5.0);
  EXPECT_GT(absence.begins_s - absence.moved_s, kWatchdog_s - kSettles_s);
  EXPECT_LT(absence.begins_s - absence.moved_s, kWatchdog_s + kSettles_s);
  EXPECT_GT(absence.ends_s, resumed_s);
  EXPECT_GT(absence.after_n, 8.0);
  const Json driver = summary()["device"][0]["driver"];
  EXPECT_GE(driver["absences"], 2) << "the tab stood still, and released the tool";
  EXPECT_GT(driver["longest_gap_s"], 0.8 * (resumed_s - halted_s));
  EXPECT_EQ(summary()["haptic"][0]["device_jumps"], 0);
}

}  // namespace
}  // namespace subworld::test

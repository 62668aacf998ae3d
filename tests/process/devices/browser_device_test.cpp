#include "process/process_test.hpp"

#include <cmath>
#include <memory>
#include <regex>

namespace subworld::test {
namespace {

/// Runs whose users are pages, and pages without a browser.
class BrowserDevice : public ProcessTest {
 protected:
  void begin(const std::string& scene_file, const Words& flags) {
    Words words{"--live", "0"};
    words.insert(words.end(), flags.begin(), flags.end());
    run_ = std::make_unique<Process>(run_words(scene_file, words), folder_.path());
    const std::regex listens("open (ws://\\S+) in L");
    ASSERT_TRUE(eventually([&] {
      std::smatch found;
      const std::string log = read_text(out() + "/logs/gui_headless.log");
      if (!std::regex_search(log, found, listens)) return false;
      address_ = found[1];
      return true;
    })) << run_->err();
  }
  void touch(const std::string& name) const {
    const TemporaryFolder folder;
    Process client(
        {"/usr/bin/python3", std::string(SOURCE_FOLDER) + "/tests/support/live_client/tool_client.py", name, address_},
        folder.path());
    EXPECT_EQ(client.wait().value_or(-1), 0) << client.err();
  }
  [[nodiscard]] Ended stop() const {
    const TemporaryFolder folder;
    Process order({program("subworld"), "control", "stop", "--domain", domain_.text()}, folder.path());
    EXPECT_EQ(order.wait().value_or(-1), 0) << order.err();
    const auto code = run_->wait();
    return {code.value_or(-1), run_->out(), run_->err()};
  }

  std::unique_ptr<Process> run_;
  std::string address_;
};

TEST_F(BrowserDevice, RefusesNonsenseAndTwoOwners) {
  begin(scene("row"), {"--device", "browser"});
  touch("nonsense");
  const Ended ended = stop();
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("page: http://127.0.0.1:"), std::string::npos) << ended.out;
  const Json driver = summary()["device"][0]["driver"];
  EXPECT_EQ(driver["name"], "browser");
  EXPECT_EQ(driver["refused"], 0);
  EXPECT_GE(driver["absences"], 1) << "the first page closed, the second one sent nothing";
  EXPECT_EQ(summary()["haptic"][0]["device_jumps"], 0);
}

constexpr double kCloses_s = 10.0, kEnds_s = 11.3;  // as the client has it
constexpr double kNoStep_n = 0.3;

struct ForceStep {
  double size_n = 0.0;
  double at_s = 0.0;
};

/// The largest change of a user's force from one millisecond to the next, before and after the tab closes.
ForceStep largest_step(const Table& table) {
  const std::size_t x = table.column("force_x_n");
  ForceStep largest;
  for (std::size_t i = 1; i < table.rows.size(); ++i) {
    const auto &now = table.rows[i], &before = table.rows[i - 1];
    if (now[0] < kCloses_s - 0.2 || now[0] > kEnds_s - 0.1) continue;
    const double size_n = std::hypot(now[x] - before[x], now[x + 1] - before[x + 1], now[x + 2] - before[x + 2]);
    if (size_n > largest.size_n) largest = {size_n, now[0]};
  }
  return largest;
}

// An emulated user and a page carry the cube; a second page presses on it from the front, and its tab closes.
TEST_F(BrowserDevice, TwoPagesAndAnEmulatedUserLiftACubeAndOneTabCloses) {
  std::string text = read_text(scene("lift"));
  const auto replace = [&](const std::string& passage, const std::string& by) {
    const std::size_t at = text.find(passage);
    ASSERT_NE(at, std::string::npos) << passage;
    text.replace(at, passage.size(), by);
  };
  replace("during_s: [0.2, 0.7]", "during_s: [6, 6.6]");
  replace("during_s: [1.0, 2.0]", "during_s: [7.5, 9]");
  std::string front = text.substr(text.find("  - name: right"));
  text += front.replace(front.find("right"), 5, "front");
  text.replace(text.rfind("[0.10, 0, 0.05]"), 15, "[0, -0.10, 0.05]");
  const std::string file = folder_.write("lift.yaml", text);
  // A machine that halts a loop for some milliseconds fades the force: then another try decides.
  ForceStep largest{.size_n = 1e9};
  int absences = 0;  // of the page that stays
  for (int tries = 0; tries < 3 && (largest.size_n > kNoStep_n || absences > 0); ++tries) {
    std::filesystem::remove_all(out());
    // Three users of 1 kHz fill two cores: then the OS takes part in what is felt.
    begin(file,
          {"--device", "emulated,browser,browser", "--duration", "11.3", "--bodies", "cube", "--set", "h_s=0.002"});
    touch("lift");
    EXPECT_EQ(run_->wait().value_or(-1), 0) << run_->err();
    absences = summary()["device"][1]["driver"]["absences"];
    largest = {};
    for (const int user : {0, 1}) {
      const ForceStep step = largest_step(read_table(out() + "/device_" + std::to_string(user) + ".csv"));
      if (step.size_n > largest.size_n) largest = step;
    }
  }
  EXPECT_LT(largest.size_n, kNoStep_n) << "at " << largest.at_s << " s";
  const Table cube = read_table(out() + "/bodies.csv");
  ASSERT_FALSE(cube.rows.empty());
  EXPECT_NEAR(cube.rows.back()[cube.column("z_m")], 0.15, 0.01) << "it is carried";
  EXPECT_GE(summary()["device"][2]["driver"]["absences"], 1) << run_->out();
  EXPECT_EQ(absences, 0) << run_->out();
  EXPECT_NE(run_->out().find("verdict: "), std::string::npos);
  EXPECT_EQ(run_->out().find("unstable"), std::string::npos) << run_->out();
}

TEST_F(BrowserDevice, IsListedAndHasNoCheck) {
  const Ended listed = finish({program("subworld"), "device", "list"});
  EXPECT_NE(listed.out.find("browser: version 1"), std::string::npos) << listed.out;
  const Ended checked = finish({program("subworld"), "device", "check", "browser"});
  EXPECT_EQ(checked.code, 2);
  EXPECT_NE(checked.err.find("subworld run press --device browser"), std::string::npos) << checked.err;
  const Ended lockstep = run(scene("press"), {"--mode", "lockstep", "--device", "browser"});
  EXPECT_EQ(lockstep.code, 2);
  EXPECT_NE(lockstep.err.find("--mode realtime"), std::string::npos) << lockstep.err;
}

}  // namespace
}  // namespace subworld::test

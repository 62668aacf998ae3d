#include "process/process_test.hpp"

#include <memory>
#include <regex>

namespace subworld::test {
namespace {

constexpr int kSkipped = 77;

class Page : public ProcessTest {
 protected:
  /// The address of the page that a command names; empty: it names none.
  static std::string address_of(Process& command) {
    const std::regex named("page: (http://127\\.0\\.0\\.1:\\d+/[\\w-]*/?)");
    std::smatch found;
    std::string text;
    const bool named_it = eventually([&] {
      text = command.out();
      return std::regex_search(text, found, named);
    });
    return named_it ? found[1].str() : std::string{};
  }
  /// Looks at a page of a command as a user does; the script's exit code. If it is not 0, the command is stopped.
  static int look(Process& command, const std::string& script, const Words& words) {
    const TemporaryFolder folder;
    Words all{"/usr/bin/python3", std::string(SOURCE_FOLDER) + "/tests/support/page_client/" + script};
    all.insert(all.end(), words.begin(), words.end());
    Process viewer(all, folder.path());
    const int code = viewer.wait(280.0).value_or(-1);
    EXPECT_TRUE(code == 0 || code == kSkipped) << viewer.out() << viewer.err();
    if (code != 0) command.signal(SIGINT);
    return code;
  }
};

/// The page of a run in a real browser: it draws, its orders work, and it outlives the display.
TEST_F(Page, ShowsAndControlsARun) {
  Process run(run_words(scene("heap"), {"--mode", "realtime", "--duration", "1000", "--ratio", "4-8", "--page"}),
              folder_.path());
  const std::string address = address_of(run);
  ASSERT_NE(address, "") << run.err();
  if (look(run, "page_client.py", {address, out()}) == kSkipped) FAIL() << "no Chromium, or a build without the page";
  EXPECT_EQ(run.wait().value_or(-1), 0) << run.err();  // the page has stopped it
}

/// A person reads, touches and answers in a browser.
TEST_F(Page, ConductsAStudy) {
  const std::string file =
      folder_.write("study.yaml",
                    "name: page\nscene: press\nflags: {mode: realtime, duration: 2, device: browser, page: true}\n"
                    "conditions: {a: {}, b: {}}\norder: fixed\ninstructions: Judge what you feel.\nquestions:\n"
                    "  - {name: hard, text: \"How hard?\", from: 1, to: 7}\n  - {name: percent, text: \"Percent?\", "
                    "from: 0, to: 100}\n");
  Process study({program("subworld_study"), file, "--out", out(), "--page"}, folder_.path());
  const std::string address = address_of(study);
  ASSERT_NE(address, "") << study.err();
  ASSERT_NE(look(study, "study_client.py", {address}), kSkipped) << "no Chromium, or a build without the page";
  EXPECT_EQ(study.wait().value_or(-1), 0) << study.err();
  const std::string table = read_text(out() + "/trials_1.csv");
  EXPECT_EQ(std::ranges::count(table, '\n'), 3) << table;
  for (const char* row : {"page,1,0,0,a,", "page,1,1,0,b,", ",2,42\n"})
    EXPECT_NE(table.find(row), std::string::npos) << table;
}

/// The page of a run that misses gates shows its verdict, with the gates that are not ok.
TEST_F(Page, ShowsTheVerdictAndTheGatesThatAreMissed) {
  Process run(run_words(overloaded_heap(),
                        {"--mode", "realtime", "--duration", "1000", "--set", "haptic.preset=quality", "--page"}),
              folder_.path());
  const std::string address = address_of(run);
  ASSERT_NE(address, "") << run.err();
  if (look(run, "verdict_client.py", {address, out() + "/summary.json"}) == kSkipped)
    FAIL() << "no Chromium, or a build without the page";
  EXPECT_EQ(run.wait().value_or(-1), 0) << run.err();
}

TEST_F(Page, ShowsWhyARunHasFailed) {
  Process run(run_words(scene("row"), {"--mode", "realtime", "--duration", "1000", "--page"}), folder_.path());
  const std::string address = address_of(run);
  ASSERT_NE(address, "") << run.err();
  std::string victim;
  ASSERT_TRUE(eventually([&] {
    for (const Running& one : running(out()))
      if (one.words.front().ends_with("haptic_sim")) victim = std::to_string(one.pid);
    return !victim.empty();
  }));
  if (look(run, "verdict_client.py", {address, out() + "/summary.json", victim}) == kSkipped)
    FAIL() << "no Chromium, or a build without the page";
  EXPECT_EQ(run.wait().value_or(-1), 1) << run.err();
  EXPECT_TRUE(summary()["verdict"].get<std::string>().starts_with("failed: haptic_sim_0 killed by SIGKILL"));
}

/// The bar of a recording: play, step, speed, and any moment by mouse and keyboard. Joints are drawn until they break.
TEST_F(Page, MovesThroughARecording) {
  const std::string file = folder_.path() + "/run.mcap";
  ASSERT_EQ(run(glued_lever(), {"--mode", "lockstep", "--duration", "6", "--record", file}).code, 0);
  Process replay({program("subworld"), "replay", file, "--page", "--paused", "--domain", domain_.text(), "--out",
                  folder_.path() + "/shown"},
                 folder_.path());
  const std::string address = address_of(replay);
  ASSERT_NE(address, "") << replay.err();
  if (look(replay, "replay_client.py", {address, "6"}) == kSkipped)
    FAIL() << "no Chromium, or a build without the page";
  EXPECT_EQ(replay.wait().value_or(-1), 0) << replay.err();  // the page has stopped it
}

}  // namespace
}  // namespace subworld::test

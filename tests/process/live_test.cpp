#include "process/process_test.hpp"

#include <memory>
#include <regex>

namespace subworld::test {
namespace {

/// A run with a display that serves viewers, and viewers written in Python. The run goes on until it is stopped.
class Live : public ProcessTest {
 protected:
  void begin(const Words& flags = {}, const Environment& environment = {}, const std::string& name = "row") {
    Words words{"--mode", "realtime", "--duration", "1000", "--live", "0"};
    words.insert(words.end(), flags.begin(), flags.end());
    run_ = std::make_unique<Process>(run_words(scene(name), words), folder_.path(), environment);
    const std::regex listens("open (ws://\\S+) in L");
    ASSERT_TRUE(eventually([&] {
      std::smatch found;
      const std::string log = display_log();
      if (!std::regex_search(log, found, listens)) return false;
      address_ = found[1];
      return true;
    })) << run_->err();
  }

  void view(const std::string& name, const Words& more = {}, const Environment& environment = {}) const {
    Words words{"/usr/bin/python3", std::string(SOURCE_FOLDER) + "/tests/support/live_client/live_client.py", name,
                address_};
    words.insert(words.end(), more.begin(), more.end());
    const TemporaryFolder folder;
    Process viewer(words, folder.path(), environment);
    EXPECT_EQ(viewer.wait().value_or(-1), 0) << viewer.err();
  }

  /// Whatever the viewers did, the run ends in order and has its picture.
  void end() const {
    const TemporaryFolder folder;
    Process stop({program("subworld"), "control", "stop", "--domain", domain_.text()}, folder.path());
    EXPECT_EQ(stop.wait().value_or(-1), 0) << stop.err();
    EXPECT_EQ(run_->wait().value_or(-1), 0) << run_->err();
    EXPECT_TRUE(std::filesystem::exists(out() + "/picture.png")) << display_log();
    const std::string log = display_log();
    EXPECT_EQ(log.find("error"), std::string::npos) << log;
    EXPECT_EQ(log.find("viewers:"), log.rfind("viewers:")) << "a fault in the server: " << log;
  }

  [[nodiscard]] std::string display_log() const { return read_text(out() + "/logs/gui_headless.log"); }
  [[nodiscard]] double memory_mb() const {
    for (const Running& one : running(out())) {
      if (!one.words.front().ends_with("gui_headless")) continue;
      std::smatch found;
      const std::string status = read_text("/proc/" + std::to_string(one.pid) + "/status");
      if (std::regex_search(status, found, std::regex("VmRSS:\\s+(\\d+) kB"))) return std::stod(found[1]) / 1000.0;
    }
    ADD_FAILURE() << "no display";
    return 0.0;
  }

  std::unique_ptr<Process> run_;
  std::string address_;
};

class LiveProtocol : public Live, public ::testing::WithParamInterface<std::string> {};

TEST_P(LiveProtocol, EveryTopicIsRead) {
  begin({"--dds", "mixed"}, {}, "lever");
  view("read_all", {GetParam()});
  end();
}

INSTANTIATE_TEST_SUITE_P(Protocols, LiveProtocol, ::testing::Values("foxglove.sdk.v1"),
                         [](const auto&) { return "sdk"; });
INSTANTIATE_TEST_SUITE_P(FullRealtime, LiveProtocol, ::testing::Values("foxglove.websocket.v1"),
                         [](const auto&) { return "websocket"; });

TEST_F(Live, SendsAtMost60SamplesASecond) {
  begin();
  view("rates");
  view("arrows");
  end();
}

TEST_F(Live, AnswersOrEndsWrongClients) {
  begin();
  view("garbage");
  end();
}

TEST_F(Live, OutlivesClientsThatComeAndGo) {
  begin();
  view("churn");
  end();
}

TEST_F(Live, TellsASlowClientWhatItMissed) {
  begin();
  view("slow");
  end();
}

TEST_F(Live, TellsAClientThatIsBusyOfTheEnd) {
  begin();
  std::string display;
  for (const Running& one : running(out()))
    if (one.words.front().ends_with("gui_headless")) display = std::to_string(one.pid);
  const TemporaryFolder folder;
  Process viewer({"/usr/bin/python3", std::string(SOURCE_FOLDER) + "/tests/support/live_client/live_client.py", "busy",
                  address_, display},
                 folder.path());
  ASSERT_TRUE(eventually([&] { return viewer.out() == "ready\n"; })) << viewer.err();
  end();
  EXPECT_EQ(viewer.wait().value_or(-1), 0) << viewer.err();
}

TEST_F(Live, DisconnectsAClientThatDoesNotRead) {
  begin();
  const double before_mb = memory_mb();
  view("stalled");
  EXPECT_LT(memory_mb() - before_mb, 40.0);
  end();
}

/// Viewers of all topics change no bit of a lock-step run.
TEST_F(Live, ChangesNoResultInLockStep) {
  const Words lockstep{"--mode", "lockstep", "--duration", "14"};
  begin(lockstep);
  view("read_all", {"foxglove.sdk.v1"});
  EXPECT_EQ(run_->wait().value_or(-1), 0) << run_->err();
  const std::string with_viewers = summary()["state_hash"];
  EXPECT_EQ(run(scene("row"), lockstep).code, 0);
  EXPECT_EQ(summary()["state_hash"], with_viewers);
}

/// What a viewer is sent at the end of a run, and what the summary then has.
class LiveVerdict : public Live {
 protected:
  void begin_with_viewer(const Words& flags = {}) {
    begin(flags);
    viewer_ = std::make_unique<Process>(
        Words{"/usr/bin/python3", std::string(SOURCE_FOLDER) + "/tests/support/live_client/live_client.py", "verdict",
              address_},
        viewer_folder_.path());
    ASSERT_TRUE(eventually([&] { return viewer_->out().find("ready") != std::string::npos; })) << viewer_->err();
  }
  [[nodiscard]] pid_t pid_of(const std::string& program) const {
    for (const Running& one : running(out()))
      if (one.words.front().ends_with(program)) return one.pid;
    ADD_FAILURE() << "no " << program;
    return -1;
  }
  /// The messages of `/verdict`, after the end of the run.
  [[nodiscard]] Json shown() const {
    EXPECT_EQ(viewer_->wait().value_or(-1), 0) << viewer_->err();
    const std::string text = viewer_->out(), begin = "verdict: ";
    const std::size_t at = text.find(begin);
    return at == std::string::npos ? Json() : Json::parse(text.substr(at + begin.size()), nullptr, false);
  }
  /// The viewer has exactly the verdict of the summary, which begins so.
  void expect_verdict(const std::string& verdict) const {
    const Json all = shown(), wanted = summary();
    ASSERT_EQ(all.size(), 1U) << all << display_log();
    EXPECT_EQ(all[0]["verdict"], wanted["verdict"]);
    EXPECT_TRUE(all[0]["verdict"].get<std::string>().starts_with(verdict)) << all;
    ASSERT_EQ(all[0]["gates"].size(), wanted["gates"].size());
    for (std::size_t i = 0; i < wanted["gates"].size(); ++i) {
      for (const auto& [key, value] : wanted["gates"][i].items()) EXPECT_EQ(all[0]["gates"][i][key], value) << key;
    }
  }

  const TemporaryFolder viewer_folder_;
  std::unique_ptr<Process> viewer_;
};

TEST_F(LiveVerdict, OfARunThatASignalStops) {
  begin_with_viewer();
  run_->signal(SIGINT);
  EXPECT_EQ(run_->wait().value_or(-1), 0) << run_->err();
  expect_verdict("stopped by SIGINT at t = ");
}

TEST_F(LiveVerdict, OfARunWhoseWorldWasKilled) {
  begin_with_viewer();
  kill(pid_of("world_sim"), SIGKILL);
  EXPECT_EQ(run_->wait().value_or(-1), 1) << run_->err();
  expect_verdict("failed: world_sim killed by SIGKILL");
}

/// The display ends with the launcher, and the viewer learns that the run has ended.
TEST_F(LiveVerdict, IsMissingWhereTheLauncherWasKilled) {
  begin_with_viewer();
  run_->signal(SIGKILL);
  EXPECT_EQ(shown(), Json::array());
  EXPECT_TRUE(eventually([&] { return summary().is_object() && running(out()).empty(); }));
}

/// It ends at once, and the run goes on.
TEST_F(LiveVerdict, IsMissingWhereASignalEndsTheDisplay) {
  begin_with_viewer();
  kill(pid_of("gui_headless"), SIGTERM);
  EXPECT_EQ(shown(), Json::array());
  end();
}

/// The display publishes its status while it waits for the verdict: a recording loses nothing of it.
TEST_F(LiveVerdict, OfARunThatIsStoppedAndRecorded) {
  begin_with_viewer({"--record", folder_.path() + "/run.mcap"});
  end();
  expect_verdict("stopped by control (");
  EXPECT_GT(summary()["gates"].size(), 5U);
  EXPECT_EQ(summary()["recording"]["messages_lost"], 0);
}

TEST_F(Live, IsReadByNoPageOfAnotherSite) {
  begin({"--origin", "https://given.example"});
  view("origins");
  end();
}

TEST_F(Live, ServesViewersBesideUnfinishedRequests) {
  begin();
  view("slow_requests");
  end();
}

TEST_F(Live, NeedsTheToken) {
  const std::string token = "row-0123456789";
  begin({"--listen", "127.0.0.2"}, {{"SUBWORLD_TOKEN", token}});
  view("token", {}, {{"TOKEN", token}});
  end();
}

TEST_F(Live, APageIsNotPromisedOnAPortThatIsTaken) {
  begin();
  const std::string port = address_.substr(address_.rfind(':') + 1);
  const TestDomain other;
  const Ended ended = finish({program("subworld"), "run", scene("row"), "--page", "--live", port, "--domain",
                              other.text(), "--out", folder_.path() + "/second"});
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find("--live " + port), std::string::npos) << ended.err;
  EXPECT_EQ(ended.out.find("page:"), std::string::npos) << ended.out;
  end();
}

TEST_F(Live, AnswersHeadAsGetWithoutTheBody) {
  begin();
  const Ended ended = finish({"/usr/bin/python3", "-c", R"(
import http.client, sys
def ask(method):
    connection = http.client.HTTPConnection(sys.argv[1][5:])
    connection.request(method, '/')
    answer = connection.getresponse()
    return answer.status, answer.getheader('Content-Length'), len(answer.read())
get, head = ask('GET'), ask('HEAD')
sys.exit(0 if get[:2] == head[:2] and get[2] > 0 and head[2] == 0 else f'{get} {head}'))",
                              address_});
  EXPECT_EQ(ended.code, 0) << ended.err;
  end();
}

TEST_F(Live, OtherHostsNeedAToken) {
  const auto refused = [&](const Words& flags, const std::string& why) {
    const Ended ended = run(scene("row"), flags);
    EXPECT_EQ(ended.code, 2);
    EXPECT_NE(ended.err.find(why), std::string::npos) << ended.err;
  };
  refused({"--live", "8765", "--listen", "0.0.0.0"}, "need a token");
  refused({"--live", "8765", "--listen", "here"}, "IP address");
  refused({"--live", "8765", "--token", "short"}, "12 characters");
  refused({"--live", "8765", "--origin", "https://example.org/page"}, "without a path");
}

}  // namespace
}  // namespace subworld::test

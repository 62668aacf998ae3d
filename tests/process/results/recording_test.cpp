#include "process/process_test.hpp"
#include "support/png_reader.hpp"

#include <fmt/core.h>

#include <sys/stat.h>

#include <filesystem>

namespace subworld::test {
namespace {

class Recording : public ProcessTest {
 protected:
  [[nodiscard]] std::string file() const { return folder_.path() + "/run.mcap"; }
  [[nodiscard]] Words recorded(Words flags) const {
    flags.insert(flags.end(), {"--record", file()});
    return flags;
  }
  /// What the public reader found; null where its packages could not be fetched.
  [[nodiscard]] Json read_all() const { return read_all(file()); }
  [[nodiscard]] Json read_all(const std::string& file) const {
    const std::string folder = MCAP_CLIENT_FOLDER;
    if (!std::filesystem::exists(folder + "/stamp")) return {};
    Process reader({"/usr/bin/env", "node", folder + "/read_all.mjs", file}, folder_.path());
    EXPECT_EQ(reader.wait().value_or(-1), 0) << reader.err();
    return Json::parse(reader.out(), nullptr, false);
  }
};

constexpr const char* kNoReader = "the public reader of MCAP could not be fetched when the tests were built";

class RecordingModes : public Recording, public ::testing::WithParamInterface<std::string> {};

TEST_P(RecordingModes, HoldsEveryMessageThatWasSent) {
  const Ended ended =
      run(scene("squeeze"), recorded({"--mode", GetParam(), "--duration", "3", "--users", "2", "--dds", "mixed"}));
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json counts = summary()["recording"];
  EXPECT_EQ(counts["messages_lost"], 0);
  EXPECT_EQ(counts["messages_recorded"], counts["messages_sent"]);
  EXPECT_EQ(counts["file"], file());
  EXPECT_NE(ended.out.find("recording: " + file()), std::string::npos) << ended.out;

  const Json read = read_all();
  if (read.is_null()) FAIL() << kNoReader;
  EXPECT_EQ(read["messages"], counts["messages_sent"]);
  EXPECT_LT(read["slowest_s"], 0.5);
  for (const auto& [topic, count] : counts["topics"].items()) {
    if (count == 0) continue;
    EXPECT_EQ(read["topics"][topic]["count"], count) << topic;
    EXPECT_EQ(read["topics"][topic]["gaps"], 0) << topic;
  }
  const Json all = summary();
  for (const std::size_t user : {0, 1}) {
    const std::string name = "/user_" + std::to_string(user);
    EXPECT_GE(counts["topics"][name + "/device_state"], all["device"][user]["steps"]);
    EXPECT_GE(counts["topics"][name + "/device_command"], all["haptic"][user]["steps"]);
    EXPECT_GE(counts["topics"][name + "/world_frame"], 100);
    EXPECT_GE(counts["topics"][name + "/haptic_report"], 100);
  }
  EXPECT_EQ(counts["topics"]["/scene"], 1);
  EXPECT_GE(counts["topics"]["/world_state"], 30);
  EXPECT_GE(counts["topics"]["/status"], 5);

  EXPECT_EQ(read["attachments"]["scene.yaml"], read_text(scene("squeeze")));
  EXPECT_EQ(read["attachments"]["summary.json"], read_text(out() + "/summary.json"));
  const Json settings = Json::parse(read["attachments"]["settings.json"].get<std::string>(), nullptr, false);
  EXPECT_EQ(settings["dds"], "mixed");
}

INSTANTIATE_TEST_SUITE_P(Modes, RecordingModes, ::testing::Values("lockstep", "realtime"),
                         [](const auto& one) { return one.param; });

TEST_F(Recording, ReSimulationHasTheRecordedHash) {
  ASSERT_EQ(run(scene("example"), recorded({"--mode", "lockstep", "--duration", "0.4", "--ratio", "5"})).code, 0);
  const std::string hash = summary()["state_hash"];
  const std::string again = folder_.path() + "/again";
  const Ended ended = finish({program("subworld"), "replay", file(), "--resimulate", "--out", again});
  EXPECT_EQ(ended.code, 0) << ended.out << ended.err;
  EXPECT_NE(ended.out.find("state hash " + hash + ", recorded " + hash + ": equal"), std::string::npos) << ended.out;
  // The scene is the recorded one, and not that of this machine.
  EXPECT_EQ(read_text(again + "/recorded/scene.yaml"), read_text(scene("example")));
  EXPECT_TRUE(std::filesystem::exists(again + "/recorded/meshes/wedge.obj"));
  std::ofstream(again + "/recorded/scene.yaml") << "changed";
  EXPECT_EQ(finish({program("subworld"), "replay", file(), "--resimulate", "--out", again}).code, 2);
  EXPECT_EQ(read_text(again + "/recorded/scene.yaml"), "changed");
}

TEST_F(Recording, AReSimulationEndsWithItsCommandAndKeepsToItsDomain) {
  ASSERT_EQ(run(scene("press"), recorded({"--mode", "lockstep", "--duration", "8"})).code, 0);
  const std::string again = folder_.path() + "/again";
  Process replay({program("subworld"), "replay", file(), "--resimulate", "--out", again, "--domain", domain_.text()},
                 folder_.path());
  ASSERT_TRUE(eventually([&] { return running(again).size() >= 4; })) << replay.err();
  EXPECT_NE(replay.out().find("domain " + domain_.text()), std::string::npos) << replay.out();
  for (const Running& one : running(again)) {
    if (std::ranges::find(one.words, "replay") != one.words.end()) kill(one.pid, SIGKILL);
  }
  EXPECT_TRUE(eventually([&] { return running(again).empty(); }));
}

struct OrderedRun {
  std::string scene;
  Words flags;
  std::vector<Words> orders;
  std::vector<std::string> recorded;
};

class RecordingOrders : public Recording, public ::testing::WithParamInterface<OrderedRun> {};

TEST_P(RecordingOrders, AreRepeatedInTheReSimulation) {
  const Environment engines{{"SUBWORLD_ENGINES", EXAMPLE_ENGINES_FOLDER}};
  Words flags = recorded({"--mode", "lockstep", "--duration", "600"});
  flags.insert(flags.end(), GetParam().flags.begin(), GetParam().flags.end());
  Process process(run_words(scene(GetParam().scene), flags), folder_.path(), engines);
  for (const Words& order : GetParam().orders) {
    Words words{program("subworld"), "control", "--domain", domain_.text(), "--wait", "30"};
    words.insert(words.end(), order.begin(), order.end());
    const Ended ended = finish(words);
    EXPECT_TRUE(ended.code == 0 || ended.err.find("refused") != std::string::npos) << ended.err;
  }
  ASSERT_EQ(process.wait().value_or(-1), 0) << process.err();
  const std::string presence = summary()["presence"];
  for (const std::string& event : GetParam().recorded) EXPECT_NE(presence.find(event), std::string::npos) << presence;

  const std::string again = folder_.path() + "/again";
  const Ended ended = finish({program("subworld"), "replay", file(), "--resimulate", "--out", again}, engines);
  EXPECT_EQ(ended.code, 0) << ended.out << ended.err << presence;
  EXPECT_NE(ended.out.find(": equal"), std::string::npos) << ended.out << presence;
  const Json repeated = Json::parse(read_text(again + "/summary.json"), nullptr, false);
  EXPECT_EQ(repeated["simulated_s"], summary()["simulated_s"]) << "ends in the cycle of the stop";
  for (const std::string& event : GetParam().recorded)
    EXPECT_NE(repeated["presence"].get<std::string>().find(event), std::string::npos) << repeated["presence"];
}

INSTANTIATE_TEST_SUITE_P(
    Runs, RecordingOrders,
    ::testing::Values(OrderedRun{"lift",
                                 {"--ratio", "4-8", "--dds", "mixed"},
                                 {{"engine", "ode"},
                                  {"engine", "bullet_float", "--preset", "quality", "--haptic"},
                                  {"ratio", "--ratio", "5-6"},
                                  {"leave", "--user", "1"},
                                  {"stop"}},
                                 {"world engine ode fast from", "world stops", "0 engine bullet_float quality from",
                                  "1 engine bullet_float quality from", "world ratio 5-6 from", "1 leaves"}},
                      // The row sleeps. `spheres` is refused, because it holds no box, and by then the row is awake.
                      OrderedRun{"row",
                                 {},
                                 {{"pause"},
                                  {"engine", "spheres"},
                                  {"engine", "havoc"},
                                  {"step"},
                                  {"engine", "ode", "--preset", "quality"},
                                  {"engine", "bullet_float"},
                                  {"resume"},
                                  {"stop"}},
                                 {"world engine spheres fast from", "world engine ode quality from",
                                  "world engine bullet_float fast from"}},
                      // Stopped while no body is near the proxy, so that messages are suppressed.
                      OrderedRun{"row", {"--set", "presence=world stops 6"}, {}, {"world stops 6"}}),
    [](const auto& one) { return one.param.scene + (one.param.orders.empty() ? "_planned" : ""); });

TEST_F(Recording, OfARunThatWasStoppedAtOnce) {
  Process process(run_words(scene("row"), recorded({"--mode", "lockstep", "--duration", "600"})), folder_.path());
  EXPECT_EQ(finish({program("subworld"), "control", "stop", "--domain", domain_.text(), "--wait", "30"}).code, 0);
  ASSERT_EQ(process.wait().value_or(-1), 0) << process.err();
  const Ended ended =
      finish({program("subworld"), "replay", file(), "--resimulate", "--out", folder_.path() + "/again"});
  const bool has_cycles = summary()["simulated_s"] > 0.0;
  EXPECT_EQ(ended.code, has_cycles ? 0 : 2) << ended.out << ended.err;
  EXPECT_TRUE(has_cycles || ended.err.find("before its first cycle") != std::string::npos) << ended.err;
}

TEST_F(Recording, ChangesNoResultInLockStep) {
  const Words flags{"--mode", "lockstep", "--duration", "0.5"};
  ASSERT_EQ(run(scene("row"), recorded(flags)).code, 0);
  const std::string with_recording = summary()["state_hash"];
  ASSERT_EQ(run(scene("row"), flags).code, 0);
  EXPECT_EQ(summary()["state_hash"], with_recording);
}

TEST_F(Recording, OfARunInRealTimeIsNotReSimulated) {
  ASSERT_EQ(run(scene("row"), recorded({"--mode", "realtime", "--duration", "0.5"})).code, 0);
  const Ended ended = finish({program("subworld"), "replay", file(), "--resimulate"});
  EXPECT_EQ(ended.code, 2);
  EXPECT_NE(ended.err.find("does not repeat"), std::string::npos) << ended.err;
}

TEST_F(Recording, ThatCannotBeWrittenToItsEndIsReportedAndTheRunGoesOn) {
  ASSERT_EQ(mkfifo(file().c_str(), 0600), 0);
  Process reader({"/usr/bin/head", "-c", "200000", file()}, folder_.path());
  const Ended ended = run(scene("row"), recorded({"--mode", "lockstep", "--duration", "1"}));
  EXPECT_EQ(ended.code, 0) << ended.err;
  const Json json = summary();
  EXPECT_GT(json["recording"]["messages_lost"], 0);
  EXPECT_NE(json["verdict"].get<std::string>().find("messages that the recording lost"), std::string::npos)
      << json["verdict"];
  EXPECT_NE(json["verdict"].get<std::string>().find("Broken pipe"), std::string::npos) << json["verdict"];
  EXPECT_EQ(reader.wait().value_or(-1), 0);
}

TEST_F(Recording, ToWhereNothingCanBeWrittenFailsBeforeAnythingRuns) {
  const std::string nowhere = folder_.path() + "/no/run.mcap";
  const Ended ended = run(scene("row"), {"--mode", "lockstep", "--duration", "0.1", "--record", nowhere});
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find(nowhere), std::string::npos) << ended.err;
}

/// The replay is steered like a run, and served like one.
TEST_F(Recording, IsPublishedAndSteered) {
  ASSERT_EQ(run(scene("row"), recorded({"--mode", "lockstep", "--duration", "2"})).code, 0);
  const std::string shown = folder_.path() + "/shown";
  const TemporaryFolder folder;
  Process replay(
      {program("subworld"), "replay", file(), "--live", "0", "--paused", "--domain", domain_.text(), "--out", shown},
      folder.path());
  const auto order = [&](const Words& words, const std::string& answer) {
    Words all{program("subworld"), "control", "--domain", domain_.text(), "--wait", "30"};
    all.insert(all.end(), words.begin(), words.end());
    const Ended ended = finish(all);
    EXPECT_EQ(ended.code, 0) << ended.err;
    EXPECT_NE(ended.out.find(answer), std::string::npos) << ended.out;
  };
  order({"step"}, "one snapshot");
  order({"seek", "--time", "1.5"}, "moved to t = 1.4");
  order({"step"}, "to t = 1.5");
  order({"seek", "--time", "0.5"}, "moved to t = 0.4");
  order({"seek", "--time", "9"}, "moved to t = 2.000");
  order({"speed", "--speed", "2"}, "speed 2");
  order({"stop"}, "stopped");
  EXPECT_EQ(replay.wait().value_or(-1), 0) << replay.err();
  EXPECT_NE(replay.out().find("viewers: open ws://"), std::string::npos) << replay.out();
}

TEST_F(Recording, IsPublishedToItsEndAtAnySpeed) {
  ASSERT_EQ(run(scene("row"), recorded({"--mode", "realtime", "--duration", "1"})).code, 0);
  const Ended ended = finish({program("subworld"), "replay", file(), "--publish", "--speed", "5", "--domain",
                              domain_.text(), "--out", folder_.path() + "/published"});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("messages published, to t = 1.00"), std::string::npos) << ended.out;
}

TEST_F(Recording, BecomesAFilm) {
  ASSERT_EQ(run(glued_lever(), recorded({"--mode", "lockstep", "--duration", "1.3"})).code, 0);
  const std::string film = folder_.path() + "/film";
  const Ended ended = finish({program("subworld"), "film", file(), "--from", "1", "--to", "1.2", "--speed", "0.5",
                              "--rate", "20", "--width", "160", "--height", "90", "--out", film});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("9 pictures of t = 1.000 to 1.200 s"), std::string::npos) << ended.out;
  EXPECT_TRUE(std::filesystem::exists(film + "/frame_000008.png"));
  const auto magenta = [&](const char* frame) {
    const Image image = read_png(film + frame);
    int sum = 0;
    for (std::size_t i = 0; i < image.rgb.size(); i += 3) {
      const std::uint8_t* p = &image.rgb[i];
      sum += p[0] > 120 && p[2] > 90 && p[0] > 2 * p[1] && p[2] > 1.7 * p[1];
    }
    return sum;
  };
  const int hinge = magenta("/frame_000008.png");
  EXPECT_GT(hinge, 4);
  EXPECT_GT(magenta("/frame_000000.png"), hinge + 4) << "the joint that breaks";
  const auto again = [&] { return finish({program("subworld"), "film", file(), "--to", "0", "--out", film}); };
  EXPECT_EQ(again().code, 0) << "pictures of a film are replaced";
  std::ofstream(film + "/frame_000000.png") << "mine";
  const Ended refused = again();
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.err.find("frame_000000.png, which Subworld has not made"), std::string::npos) << refused.err;
  EXPECT_EQ(read_text(film + "/frame_000000.png"), "mine");
  const Ended wrong = finish({program("subworld"), "film", file(), "--eye", "1,2", "--out", film});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_NE(wrong.err.find("three numbers"), std::string::npos) << wrong.err;
}

/// `lift` raises a cube by twice the height of the first picture's objects.
TEST_F(Recording, AFilmShowsTheToolsFromItsBeginningToItsEnd) {
  ASSERT_EQ(run(scene("lift"), recorded({"--mode", "lockstep", "--duration", "2.2"})).code, 0);
  const std::string film = folder_.path() + "/film";
  ASSERT_EQ(
      finish({program("subworld"), "film", file(), "--rate", "2", "--width", "320", "--height", "180", "--out", film})
          .code,
      0);
  for (int frame = 1; frame < 5; ++frame) {  // the first has no user yet
    const Image image = read_png(fmt::format("{}/frame_{:06d}.png", film, frame));
    int red = 0, at_edge = 0;
    for (int row = 0; row < image.height; ++row) {
      for (int column = 0; column < image.width; ++column) {
        const std::uint8_t* p = image.pixel(column, row);
        if (p[0] < 2 * p[1] || p[0] < 2 * p[2] || p[0] < 80) continue;
        ++red;
        at_edge += row == 0 || column == 0 || row == image.height - 1 || column == image.width - 1;
      }
    }
    EXPECT_GT(red, 100) << frame;
    EXPECT_EQ(at_edge, 0) << frame;
  }
}

/// While the run goes on, after its launcher was killed, and where nothing else is left of it.
TEST_F(Recording, WithoutAnEndIsReadAsFarAsItGoes) {
  Process process(run_words(scene("row"), recorded({"--mode", "lockstep", "--duration", "600"})), folder_.path());
  ASSERT_TRUE(
      eventually([&] { return std::filesystem::exists(file()) && std::filesystem::file_size(file()) > 4'000'000; }));
  const auto replayed = [&](const Words& flags, const std::string& text) {
    Words words{program("subworld"), "replay", file(), "--out", folder_.path() + "/again"};
    words.insert(words.end(), flags.begin(), flags.end());
    const Ended ended = finish(words);
    EXPECT_NE((ended.out + ended.err).find(text), std::string::npos) << ended.out << ended.err;
    return ended.code;
  };
  EXPECT_EQ(replayed({}, "is still being recorded"), 0);
  EXPECT_NE(finish({program("subworld"), "report", out()}).err.find("wait for its end"), std::string::npos);
  kill(process.pid(), SIGKILL);
  ASSERT_TRUE(eventually([&] { return std::filesystem::exists(out() + "/summary.json"); }));
  ASSERT_TRUE(eventually([&] { return running(folder_.path()).empty(); }));
  // A process that ends has no command line any more, but may hold the file for a moment.
  ASSERT_TRUE(eventually([&] {
    const Ended ended = finish({program("subworld"), "replay", file(), "--out", folder_.path() + "/again"});
    return ended.code == 0 && (ended.out + ended.err).find("recorder was killed") != std::string::npos;
  }));
  EXPECT_EQ(replayed({}, "verdict: failed: the launcher was killed"), 0);
  EXPECT_EQ(replayed({"--publish", "--speed", "1000", "--domain", domain_.text()}, "messages published"), 0);
  const std::string whole = folder_.path() + "/whole.mcap";
  EXPECT_EQ(replayed({"--repair", file()}, "name another file"), 2);
  EXPECT_EQ(replayed({"--repair", whole}, "and the summary of the run"), 0);
  const Ended repaired = finish({program("subworld"), "replay", whole});
  EXPECT_EQ(repaired.code, 0) << repaired.err;
  EXPECT_NE(repaired.out.find("verdict: failed: the launcher was killed"), std::string::npos) << repaired.out;
  EXPECT_EQ(repaired.out.find("no end"), std::string::npos) << repaired.out;
  const Json read = read_all(whole);
  if (read.is_null()) FAIL() << kNoReader;
  EXPECT_NE(repaired.out.find(", " + std::to_string(read["messages"].get<int>()) + " messages"), std::string::npos)
      << repaired.out << read["messages"];
  const Ended film = finish({program("subworld"), "film", file(), "--to", "0.5", "--rate", "4", "--width", "160",
                             "--height", "90", "--out", folder_.path() + "/film"});
  EXPECT_EQ(film.code, 0) << film.err;
  EXPECT_NE(film.out.find("recorder was killed"), std::string::npos) << film.out;
  std::filesystem::remove_all(out());
  EXPECT_EQ(replayed({}, "state hash none"), 0);
  EXPECT_EQ(replayed({"--resimulate"}, "no state hash"), 2);
}

TEST_F(Recording, DamageIsFound) {
  ASSERT_EQ(run(scene("row"), recorded({"--mode", "lockstep", "--duration", "0.1"})).code, 0);
  std::string whole = read_text(file());
  const auto replay_of = [&](const std::string& contents) {
    std::ofstream(file(), std::ios::binary) << contents;
    return finish({program("subworld"), "replay", file()});
  };
  EXPECT_EQ(replay_of(whole).code, 0);
  const Ended cut = replay_of(whole.substr(0, whole.size() - 40));
  EXPECT_EQ(cut.code, 0);
  EXPECT_NE(cut.out.find("no end"), std::string::npos) << cut.out;
  whole[whole.size() - 60] ^= 1;
  const Ended damaged = replay_of(whole);
  EXPECT_EQ(damaged.code, 2);
  EXPECT_NE(damaged.err.find("checksum"), std::string::npos) << damaged.err;
}

}  // namespace
}  // namespace subworld::test

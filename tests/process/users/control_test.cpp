#include "process/process_test.hpp"

#include <chrono>
#include <memory>
#include <thread>

namespace subworld::test {
namespace {

class Control : public ProcessTest {
 protected:
  Ended control(Words words, const std::string& dds = "fastdds", const std::string& wait_s = "20") const {
    words.insert(words.begin(), {program("subworld"), "control"});
    words.insert(words.end(), {"--domain", domain_.text(), "--dds", dds, "--wait", wait_s});
    return finish(words);
  }
};

class LiveChange : public Control, public ::testing::WithParamInterface<std::tuple<std::string, std::string>> {};

TEST_P(LiveChange, OfBothEnginesIsAnsweredAndWrittenDown) {
  const auto& [mode, dds] = GetParam();
  // Lock-step is not bound to wall time: the run is long enough to receive orders, and ends by an order.
  Process process(run_words(scene("press"), {"--mode", mode, "--duration", "600", "--dds", dds}), folder_.path());
  const Ended haptic = control({"engine", "bullet_float", "--haptic"}, dds);
  EXPECT_EQ(haptic.code, 0) << haptic.err;
  EXPECT_NE(haptic.out.find("haptic_sim 0: engine bullet -> bullet_float"), std::string::npos) << haptic.out;
  EXPECT_NE(haptic.out.find("force steps"), std::string::npos) << haptic.out;
  const Ended world = control({"engine", "bullet_float", "--preset", "quality"}, dds);
  EXPECT_EQ(world.code, 0) << world.err;
  EXPECT_NE(world.out.find("world_sim: engine bullet -> bullet_float"), std::string::npos) << world.out;

  const Ended unknown = control({"engine", "havoc"}, dds);
  EXPECT_EQ(unknown.code, 1);
  EXPECT_NE(unknown.err.find("bullet_float"), std::string::npos) << "names those there are: " << unknown.err;
  const Ended preset = control({"engine", "bullet", "--haptic", "--preset", "best"}, dds);
  EXPECT_EQ(preset.code, 1);
  EXPECT_NE(preset.err.find("quality"), std::string::npos) << preset.err;

  EXPECT_EQ(control({"stop"}, dds).code, 0);
  ASSERT_EQ(process.wait(), 0) << process.err();
  const Json json = summary();
  ASSERT_EQ(json["world"]["engine_changes"].size(), 1U);
  EXPECT_EQ(json["world"]["engine_changes"][0]["to"], "bullet_float");
  ASSERT_EQ(json["haptic"][0]["engine_changes"].size(), 1U);
  EXPECT_EQ(json["haptic"][0]["engine_changes"][0]["from"], "bullet");
}

INSTANTIATE_TEST_SUITE_P(Modes, LiveChange,
                         ::testing::Values(std::tuple{"realtime", "fastdds"}, std::tuple{"lockstep", "cyclonedds"}),
                         [](const auto& one) { return std::get<0>(one.param) + "_" + std::get<1>(one.param); });
INSTANTIATE_TEST_SUITE_P(FullRealtime, LiveChange, ::testing::Values(std::tuple{"realtime", "cyclonedds"}),
                         [](const auto& one) { return std::get<0>(one.param) + "_" + std::get<1>(one.param); });

class SecuredRun : public Control, public ::testing::WithParamInterface<std::string> {};

TEST_P(SecuredRun, HasTheSameResultAndObeysItsOwnOnly) {
  const std::string keys = folder_.path() + "/keys", others = folder_.path() + "/others";
  for (const std::string& made : {keys, others}) ASSERT_EQ(finish({program("subworld"), "keys", "make", made}).code, 0);
  const Words flags{"--duration", "0.2", "--dds", GetParam()};
  const auto hash = [&](const Words& more) {
    Words words = flags;
    words.insert(words.end(), more.begin(), more.end());
    EXPECT_EQ(run(scene("press"), words).code, 0);
    return summary()["state_hash"].get<std::string>();
  };
  EXPECT_EQ(hash({}), hash({"--secure", keys}));

  Process process(run_words(scene("press"), {"--duration", "600", "--dds", GetParam(), "--secure", keys}),
                  folder_.path());
  EXPECT_EQ(control({"pause", "--secure", keys}, GetParam()).code, 0);
  EXPECT_EQ(control({"stop"}, GetParam(), "2").code, 3);
  EXPECT_EQ(control({"stop", "--secure", others}, GetParam(), "2").code, 3);
  EXPECT_EQ(control({"resume", "--secure", keys}, GetParam()).code, 0);
  EXPECT_EQ(control({"stop", "--secure", keys}, GetParam()).code, 0);
  EXPECT_EQ(process.wait(), 0) << process.err();
}

INSTANTIATE_TEST_SUITE_P(Vendors, SecuredRun, ::testing::Values("fastdds", "cyclonedds"),
                         [](const auto& one) { return one.param; });

TEST_F(Control, ASecuredRunNeedsAllKeysAndOneVendor) {
  const std::string keys = folder_.path() + "/" + std::string(240, 'k');
  ASSERT_EQ(finish({program("subworld"), "keys", "make", keys}).code, 0);
  EXPECT_EQ(finish({program("subworld"), "keys", "make", keys}).code, 2) << "it overwrites none";
  EXPECT_EQ(finish({program("subworld"), "keys", "check", keys}).code, 0);
  const Ended mixed = run(scene("press"), {"--dds", "mixed", "--secure", keys});
  EXPECT_EQ(mixed.code, 2);
  EXPECT_NE(mixed.err.find("use one vendor"), std::string::npos) << mixed.err;
  const Ended without_openssl =
      run(scene("press"), {"--secure", keys, "--duration", "0.1"}, {{"PATH", folder_.path()}});
  EXPECT_EQ(without_openssl.code, 0) << without_openssl.err;
  const std::string key = keys + "/device_sim_0/key.pem", other = keys + "/haptic_sim_0/key.pem";
  std::filesystem::copy_file(other, key, std::filesystem::copy_options::overwrite_existing);
  const Ended swapped = run(scene("press"), {"--secure", keys});
  EXPECT_EQ(swapped.code, 2) << swapped.err;
  EXPECT_NE(swapped.err.find("device_sim_0: key.pem does not belong to certificate.pem"), std::string::npos)
      << swapped.err;
  std::filesystem::remove(key);
  const Ended lacks = run(scene("press"), {"--secure", keys});
  EXPECT_EQ(lacks.code, 3);
  EXPECT_NE(lacks.err.find("/device_sim_0/key.pem: No such file"), std::string::npos) << lacks.err;
  EXPECT_EQ(finish({program("subworld"), "keys", "check", keys}).code, 1);
}

TEST_F(Control, NarrowsTheBoundsOfTheRatio) {
  Process process(run_words(scene("press"), {"--mode", "lockstep", "--duration", "600", "--ratio", "4-12"}),
                  folder_.path());
  const Ended narrow = control({"ratio", "--ratio", "7"});
  EXPECT_EQ(narrow.code, 0) << narrow.err;
  EXPECT_NE(narrow.out.find("world_sim: ratio 7"), std::string::npos) << narrow.out;
  const Ended wide = control({"ratio", "--ratio", "2-12"});
  EXPECT_EQ(wide.code, 1);
  EXPECT_NE(wide.err.find("started with --ratio 4-12"), std::string::npos) << wide.err;
  EXPECT_EQ(control({"ratio"}).code, 2);
  EXPECT_EQ(control({"stop"}).code, 0);
  ASSERT_EQ(process.wait(), 0) << process.err();
  const Table cycles = read_table(out() + "/world.csv");
  EXPECT_EQ(cycles.rows.back()[cycles.column("ratio")], 7.0);
}

TEST_F(Control, RefusesToChangeAFixedRatio) {
  Process process(run_words(scene("press"), {"--mode", "lockstep", "--duration", "600"}), folder_.path());
  const Ended refused = control({"ratio", "--ratio", "4"});
  EXPECT_EQ(refused.code, 1);
  EXPECT_NE(refused.err.find("fixed at"), std::string::npos) << refused.err;
  EXPECT_EQ(control({"stop"}).code, 0);
  EXPECT_EQ(process.wait(), 0) << process.err();
}

TEST_F(Control, PausesStepsResumesAndStops) {
  Process process(run_words(scene("press"), {"--mode", "lockstep", "--duration", "600"}), folder_.path());
  for (const char* verb : {"pause", "step", "resume", "stop"}) {
    const Ended ended = control({verb});
    EXPECT_EQ(ended.code, 0) << verb << ": " << ended.err;
    EXPECT_NE(ended.out.find("world_sim: "), std::string::npos) << verb << " was not answered: " << ended.out;
  }
  EXPECT_EQ(process.wait(), 0) << process.err();
}

// The others go on; the same user may join again, with programs that are started by hand.
TEST_F(Control, AUserLeavesAndJoinsAgain) {
  const Words flags{"--mode", "realtime", "--duration", "600", "--set", "users.budget_ratio=0.3"};
  Process process(run_words(scene("lift"), flags), folder_.path());
  ASSERT_TRUE(eventually([&] { return read_text(out() + "/haptic_1.csv").size() > 10000; })) << process.err();
  const Ended left = control({"leave", "--user", "1"});
  EXPECT_EQ(left.code, 0) << left.err;
  EXPECT_NE(left.out.find("user 1 leaves at t = "), std::string::npos) << left.out;
  EXPECT_TRUE(eventually([&] { return running(out()).size() == 5; }))
      << "launcher, its keeper, world, and the programs of one user";
  EXPECT_EQ(control({"leave", "--user", "1"}).code, 1) << "it is absent already";
  EXPECT_EQ(control({"leave", "--user", "7"}).code, 1) << "there is no such user";

  std::vector<std::unique_ptr<Process>> again;
  for (const char* name : {"haptic_sim", "device_sim"}) {
    const std::string folder = folder_.path() + "/" + name;
    std::filesystem::create_directories(folder);
    Words words{program(name), scene("lift"), "--user", "1", "--domain", domain_.text(), "--out", folder};
    words.insert(words.end(), flags.begin(), flags.end());
    again.push_back(std::make_unique<Process>(words, folder));
  }
  EXPECT_TRUE(eventually([&] { return read_text(folder_.path() + "/haptic_sim/haptic_1.csv").size() > 10000; }))
      << again.front()->err();
  EXPECT_EQ(control({"stop"}).code, 0);
  EXPECT_EQ(process.wait(), 0) << process.err();
  for (const auto& one : again) EXPECT_EQ(one->wait(), 0) << one->err();
  const Json absences = summary()["world"]["absences"];
  ASSERT_EQ(absences.size(), 1U);
  EXPECT_EQ(absences[0]["user"], 1);
  EXPECT_EQ(absences[0]["by_order"], true);
}

// Real time: the run begins without a user, who joins with programs that are started later.
TEST_F(Control, ARunBeginsWithoutAUserWhoJoinsLater) {
  const Words flags{"--mode", "realtime", "--duration", "600", "--set", "users.budget_ratio=0.3"};
  Words words = run_words(scene("lift"), flags);
  words.insert(words.end(), {"--without", "1"});
  Process process(words, folder_.path());
  ASSERT_TRUE(eventually([&] { return read_text(out() + "/haptic_0.csv").size() > 10000; })) << process.err();
  EXPECT_FALSE(std::filesystem::exists(out() + "/haptic_1.csv"));
  std::vector<std::unique_ptr<Process>> later;
  for (const char* name : {"haptic_sim", "device_sim"}) {
    const std::string folder = folder_.path() + "/" + name;
    std::filesystem::create_directories(folder);
    Words its{program(name), scene("lift"), "--user", "1", "--domain", domain_.text(), "--out", folder};
    its.insert(its.end(), flags.begin(), flags.end());
    later.push_back(std::make_unique<Process>(its, folder));
  }
  EXPECT_TRUE(eventually([&] { return read_text(folder_.path() + "/haptic_sim/haptic_1.csv").size() > 10000; }))
      << later.front()->err();
  EXPECT_EQ(control({"stop"}).code, 0);
  EXPECT_EQ(process.wait(), 0) << process.err();
  for (const auto& one : later) EXPECT_EQ(one->wait(), 0) << one->err();
  const Json absences = summary()["world"]["absences"];
  ASSERT_EQ(absences.size(), 1U);
  EXPECT_EQ(absences[0]["user"], 1);
  EXPECT_EQ(absences[0]["from_s"], 0.0);
  EXPECT_LT(absences[0]["to_s"].get<double>(), summary()["simulated_s"].get<double>());
}

// The summary has the results of those who took part, under their own numbers.
TEST_F(Control, ARunEndsWithoutAUserWhoNeverJoins) {
  const Ended ended = run(
      scene("lift"), {"--mode", "realtime", "--duration", "1", "--set", "users.budget_ratio=0.3", "--without", "0"});
  EXPECT_EQ(ended.code, 0) << ended.err;
  const Json json = summary();
  EXPECT_NE(json["verdict"].get<std::string>().find("user 0 took no part"), std::string::npos) << json["verdict"];
  ASSERT_EQ(json["haptic"].size(), 1U);
  EXPECT_EQ(json["haptic"][0]["user"], 1);
  for (const Json& gate : json["gates"]) EXPECT_FALSE(gate["name"].get<std::string>().starts_with("user 0")) << gate;
}

TEST_F(Control, ARunNeedsAUserAtItsStart) {
  EXPECT_EQ(run(scene("lift"), {"--mode", "realtime", "--without", "0,1"}).code, 2);
  EXPECT_EQ(run(scene("lift"), {"--mode", "realtime", "--without", "7"}).code, 2);
  EXPECT_EQ(run(scene("lift"), {"--mode", "lockstep", "--without", "1"}).code, 2);
}

// A world that is started again does not wait for a user who has left by order.
TEST_F(Control, ARestartedWorldGoesOnWithoutAUserWhoHasLeft) {
  Process process(
      run_words(scene("lift"), {"--mode", "realtime", "--duration", "600", "--set", "users.budget_ratio=0.3",
                                "--restart", "on-failure", "--checkpoint", "0.1", "--wait", "5"}),
      folder_.path());
  ASSERT_TRUE(eventually([&] { return read_text(out() + "/haptic_1.csv").size() > 10000; })) << process.err();
  ASSERT_EQ(control({"leave", "--user", "1"}).code, 0);
  const auto programs_of_one_user = [&] { return running(out()).size() == 5; };  // with launcher, keeper and world
  ASSERT_TRUE(eventually(programs_of_one_user));
  const auto size_of_history = [&] { return std::filesystem::file_size(out() + "/world.csv"); };
  const auto left = size_of_history();
  ASSERT_TRUE(eventually([&] { return size_of_history() > left + 20000; })) << "a checkpoint without this user";
  pid_t world = 0;
  for (const Running& one : running(out())) {
    if (one.words.front().ends_with("/world_sim")) world = one.pid;
  }
  ASSERT_EQ(kill(world, SIGKILL), 0);
  const auto killed = size_of_history();
  EXPECT_TRUE(eventually([&] { return size_of_history() > killed + 20000; })) << process.err();
  EXPECT_EQ(control({"stop"}).code, 0);
  EXPECT_EQ(process.wait(), 0) << process.err() << process.out();
  const Json absences = summary()["world"]["absences"];
  ASSERT_EQ(absences.size(), 1U);
  EXPECT_EQ(absences[0]["by_order"], true);
}

// The launcher names a program that does not advance for 3 s, and such a run fails. A paused world does not advance
// either.
TEST_F(Control, APauseIsNotTakenForAStall) {
  Process process(run_words(scene("press"), {"--mode", "realtime", "--duration", "600"}), folder_.path());
  ASSERT_EQ(control({"pause"}).code, 0);
  std::this_thread::sleep_for(std::chrono::seconds(4));
  ASSERT_EQ(control({"stop"}).code, 0);
  EXPECT_EQ(process.wait(), 0) << process.err();
  EXPECT_EQ(process.err().find("has not advanced"), std::string::npos) << process.err();
  // The time of the pause is in no figure, and the verdict names the sender of the stop.
  for (const char* program : {"haptic", "device"})
    EXPECT_LT(summary()[program][0]["round_trip_s"]["p50"].get<double>(), 0.5) << program;
  EXPECT_NE(summary()["verdict"].get<std::string>().find(", process "), std::string::npos) << summary()["verdict"];
}

// A device moves while the world is paused. This must neither load the coupling nor throw the tool afterwards.
TEST_F(Control, AnOperatorThatMovesDuringAPauseReEngagesWithoutAJump) {
  Json haptic;
  // If the machine delays a loop, the operator moves meanwhile, and this is felt: such a run is repeated.
  for (int attempt = 0; attempt < 3; ++attempt) {
    Process process(run_words(scene("row"), {"--mode", "realtime", "--duration", "4", "--scheme", "reduced"}),
                    folder_.path());
    ASSERT_EQ(control({"pause"}).code, 0);
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    ASSERT_EQ(control({"resume"}).code, 0);
    ASSERT_EQ(process.wait(), 0) << process.err();
    haptic = summary()["haptic"][0];
    if (haptic["lateness_s"]["max"].get<double>() < 0.05) break;
  }
  EXPECT_LT(haptic["force_max_n"].get<double>(), 20.0) << "of 12 N without a pause, and a limit of 40 N";
  EXPECT_LT(haptic["energy_excess_j"].get<double>(), 0.02);
}

// A slow sub-world has frames waiting: frames of the paused world must not displace later ones.
TEST_F(Control, AnOverloadedSubWorldGoesOnAfterAPause) {
  Process process(
      run_words(overloaded_heap(), {"--mode", "realtime", "--duration", "600", "--set", "haptic.preset=quality"}),
      folder_.path());
  for (const char* verb : {"pause", "resume", "pause", "resume"}) {
    const Ended ended = control({verb});
    EXPECT_EQ(ended.code, 0) << verb << ": " << ended.err;
    std::this_thread::sleep_for(std::chrono::seconds(1));
  }
  EXPECT_EQ(control({"stop"}).code, 0);
  EXPECT_EQ(process.wait(), 0) << process.err();
  const Json json = summary();
  EXPECT_EQ(read_table(out() + "/haptic_0.csv").rows.size(), json["haptic"][0]["steps"].get<std::size_t>());
}

void expect_says(const Ended& ended, std::initializer_list<std::string> parts) {
  for (const std::string& part : parts)
    EXPECT_NE(ended.err.find(part), std::string::npos) << part << " is not in: " << ended.err;
}

TEST_F(Control, AnEngineThatIsStillBeingPreparedIsNoSuccess) {
  Process process(run_words(scene("press"), {"--mode", "realtime", "--duration", "600"}), folder_.path(),
                  {{"SUBWORLD_ENGINES", SLOW_ENGINE_FOLDER}});
  ASSERT_EQ(control({"resume"}).code, 0) << "it does not run";
  const Ended world = control({"engine", "slow"}, "fastdds", "2");
  EXPECT_EQ(world.code, 1) << world.out;
  expect_says(world, {"world_sim (so far: \"preparing engine slow\")", "2 s", "--wait"});
  EXPECT_EQ(world.err.find("resume"), std::string::npos) << world.err;
  const Ended haptic = control({"engine", "slow", "--haptic"}, "fastdds", "2");
  EXPECT_EQ(haptic.code, 1) << haptic.out;
  expect_says(haptic, {"haptic_sim 0 (so far: \"preparing engine slow\")", "--wait"});

  EXPECT_EQ(control({"stop"}).code, 0);
  EXPECT_EQ(process.wait(), 0) << process.err();
}

TEST_F(Control, ASubWorldOfAPausedLockstepWorldIsNamedAndFollowsOnceItSteps) {
  Process process(run_words(scene("lift"), {"--mode", "lockstep", "--duration", "600", "--users", "2"}),
                  folder_.path());
  ASSERT_EQ(control({"pause"}).code, 0);
  const Ended silent = control({"engine", "bullet_float", "--haptic"}, "fastdds", "3");
  EXPECT_EQ(silent.code, 1) << silent.out;
  expect_says(silent, {"haptic_sim 0 and haptic_sim 1", "3 s", "subworld control resume"});
  const Ended world = control({"engine", "bullet_float"});
  EXPECT_EQ(world.code, 0) << "the world itself follows while it is paused: " << world.err;

  EXPECT_EQ(control({"resume"}).code, 0);
  const Ended both = control({"engine", "bullet", "--haptic"});
  EXPECT_EQ(both.code, 0) << both.err;
  for (const char* who : {"haptic_sim 0: engine", "haptic_sim 1: engine"}) {
    EXPECT_NE(both.out.find(who + std::string(" bullet_float -> bullet ")), std::string::npos)
        << who << " did not answer this order: " << both.out;
  }
  EXPECT_EQ(both.out.find("-> bullet_float"), std::string::npos) << "an answer to the earlier order: " << both.out;
  EXPECT_EQ(control({"stop"}).code, 0);
  ASSERT_EQ(process.wait(), 0) << process.err();
  const Json json = summary();
  for (std::size_t user : {0, 1}) {
    ASSERT_EQ(json["haptic"][user]["engine_changes"].size(), 2U);
    EXPECT_EQ(json["haptic"][user]["engine_changes"][0]["to"], "bullet_float") << "the order of the pause was lost";
  }
}

TEST_F(Control, TheHelpShowsExamplesOfItsOwn) {
  const std::string help = finish({program("subworld"), "control", "--help"}).out;
  EXPECT_NE(help.find("subworld control engine "), std::string::npos) << help;
  EXPECT_EQ(help.find("subworld run "), std::string::npos) << help;
}

TEST_F(Control, WrongWordsAreUsageErrorsThatNameTheCure) {
  const Ended nameless = control({"engine"});
  EXPECT_EQ(nameless.code, 2);
  EXPECT_NE(nameless.err.find("subworld control engine"), std::string::npos) << nameless.err;
  EXPECT_EQ(control({"pause", "bullet"}).code, 2);
  EXPECT_EQ(control({"explode"}).code, 2);
}

}  // namespace
}  // namespace subworld::test

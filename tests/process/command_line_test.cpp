#include "process/process_test.hpp"

namespace subworld::test {
namespace {

void expect_says(const Ended& ended, const Words& fragments) {
  for (const std::string& fragment : fragments)
    EXPECT_NE(ended.err.find(fragment), std::string::npos) << "\"" << fragment << "\" is not in: " << ended.err;
}

class CommandLine : public ProcessTest {};

TEST_F(CommandLine, WrongFlagsAreNamedWithTheirChoices) {
  const std::vector<std::pair<Words, Words>> wrong{
      {{"--ratio", "0"}, {"--ratio", "1", "1000"}},
      {{"--ratio", "2.5"}, {"--ratio"}},
      {{"--ratio", "5-2"}, {"--ratio", "2-5"}},
      {{"--mode", "foo"}, {"--mode", "foo", "lockstep", "realtime"}},
      {{"--users", "9"}, {"--users 9", "declares 1 user"}},
      {{"--users", "0"}, {"--users"}},
      {{"--users", "many"}, {"--users"}},
      {{"--scheme", "papers"}, {"papers", "direct, paper"}},
      {{"--engine", "havoc"}, {"havoc", "bullet"}},
      {{"--haptic-engine", "havoc"}, {"havoc", "bullet"}},
      {{"--set", "world.preset=best"}, {"best", "fast", "quality"}},
      {{"--set", "haptic.preset=best"}, {"best", "fast", "quality"}},
      {{"--dds", "opendds"}, {"--dds", "opendds", "fastdds", "cyclonedds", "mixed"}},
      {{"--domain", "233"}, {"--domain", "232"}},
      {{"--duration", "-1"}, {"--duration"}},
      {{"--latency", "50"}, {"--latency 50: must be at least 0 and at most 2 s", "did you mean 0.05 (50 ms)?"}},
      {{"--latency", "50ms"}, {"--latency 50ms: must be a number without its unit, which is s"}},
      {{"--set", "delay.loss_ratio=20"}, {"--set delay.loss_ratio=20: ", "did you mean 0.2 (20 %)?"}},
      {{"--set", "deadband=5"}, {"--set deadband=5: must be at least 0 and at most 0.27", "did you mean 0.05 (5 %)?"}},
      {{"--set", "deadbnad=0.1"}, {"--set deadbnad=0.1: unknown setting; did you mean deadband?"}},
      {{"--set", "jitter_s=0.1"}, {"unknown setting; did you mean delay.jitter_s?"}},
      {{"--set", "users.device.rate_hz=fast"}, {"must be a number"}},
      {{"--set", "users[3].box_half_m=0.1"}, {"users[3].box_half_m", "1 user"}},
      {{"--set", "users.device.degrees_of_freedom=4"}, {"must be 3 (translations) or 6"}},
      {{"--set", "users.selection=contacts"}, {"users.contact_depth"}},
      {{"--set", "gravity_m_s2=9.81"}, {"must be a list of 3 numbers"}},
      {{"--duration", "nan"}, {"--duration"}},
      {{"--duration", "inf"}, {"--duration"}},
      {{"--wait", "nan"}, {"--wait"}},
      {{"--duration"}, {"--duration"}},
      {{"--duraton", "3"}, {"unknown option --duraton", "did you mean --duration?"}},
      {{"--duraton=3", "-x"}, {"unknown option --duraton;", "did you mean --duration?"}},
      {{"--colour", "red"}, {"unknown option --colour;", "subworld run --help"}}};
  for (const auto& [flags, fragments] : wrong) {
    SCOPED_TRACE(flags.front() + " " + flags.back());
    const Ended ended = run(scene("press"), flags);
    EXPECT_EQ(ended.code, 2) << ended.err;
    expect_says(ended, fragments);
  }
}

// What was set by --set and by its short forms is what ran, in all programs; of one setting, --set wins.
TEST_F(CommandLine, SetReachesEverySetting) {
  const Ended ended = run(scene("lift"), {"--ratio", "5", "--set", "ratio=4-8", "--duration", "0.05", "--set",
                                          "users[1].device.operator.mass_kg=2", "--set", "users.box_half_m=0.3",
                                          "--set", "gravity_m_s2=[0, 0, -1.6]", "--set", "settle.duration_s=0.1"});
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json json = summary();
  EXPECT_EQ(json["ratio"], 4);
  EXPECT_EQ(json["ratio_most"], 8);
  EXPECT_EQ(json["duration_s"], 0.05);
  const Json settings = json["settings"], users = settings["users"];
  EXPECT_EQ(settings["settle_s"], 0.1);
  EXPECT_EQ(settings["haptic_engine"]["gravity_m_s2"][2], -1.6);
  EXPECT_EQ(users[0]["selection"]["box_half_m"], 0.3);
  EXPECT_EQ(users[1]["device"]["operator"]["mass_kg"], 2.0);
  EXPECT_NE(users[0]["device"].value("operator", Json::object()).value("mass_kg", 0.0), 2.0);
}

TEST_F(CommandLine, APlanListsSettings) {
  const std::string text =
      finish({program("subworld"), "plan", scene("row"), "--settings", "--set", "deadband=0.1"}).out;
  EXPECT_NE(text.find("\ndeadband = 0.1"), std::string::npos) << text;
  EXPECT_NE(text.find("default 0; at least 0 and at most 0.27"), std::string::npos) << text;
  EXPECT_NE(text.find("\nusers.device.rate_hz = 1000 Hz"), std::string::npos) << text;
}

TEST_F(CommandLine, WrongCommandsAreNamed) {
  const auto subworld = [&](const Words& rest) {
    Words words{program("subworld")};
    words.insert(words.end(), rest.begin(), rest.end());
    const Ended ended = finish(words);
    EXPECT_EQ(ended.code, 2);
    return ended;
  };
  expect_says(subworld({}), {"a command is missing", "run, plan", "--help"});
  expect_says(subworld({"fly"}), {"fly", "run", "plan"});
  expect_says(subworld({"run"}), {"scene"});
  expect_says(subworld({"plan"}), {"scene"});
  expect_says(subworld({"plan", scene("row"), "--scheme", "papers"}), {"papers", "direct, paper"});
}

TEST_F(CommandLine, ASceneIsGivenByItsFileOrItsName) {
  ASSERT_EQ(run("press", {"--duration", "0.05"}).code, 0);
  EXPECT_EQ(summary()["scene_file"], scene("press"));
  EXPECT_EQ(finish({program("subworld"), "plan", "press"}).out,
            finish({program("subworld"), "plan", scene("press")}).out);
  for (const Words& command : {Words{program("subworld"), "run"}, Words{program("subworld"), "plan"},
                               Words{program("world_sim")}, Words{program("subworld"), "lab", "coupling"}}) {
    const auto refused = [&](const std::string& name, const Words& fragments) {
      Words words = command;
      words.push_back(name);
      const Ended ended = finish(words);
      EXPECT_EQ(ended.code, 2) << ended.err;
      expect_says(ended, fragments);
    };
    refused("pres", {"\"pres\"", "deploy/scenes", "did you mean \"press\"?"});
    refused("press.yaml", {"\"press.yaml\"", "did you mean \"press\"?"});
    refused("xyzxyz", {"\"xyzxyz\"", "card_house", "tower_press"});
    refused("deploy/pres.yaml", {"deploy/pres.yaml", "no such file"});
  }
}

TEST_F(CommandLine, ARunOfFewCyclesIsWarnedOf) {
  const auto warned = [&](const std::string& ratio) {
    const Ended ended = finish({program("subworld"), "plan", "row", "--ratio", ratio});
    EXPECT_EQ(ended.code, 0) << ended.err;
    return ended.err;
  };
  EXPECT_NE(warned("1000").find("only 3 times in the 3 s"), std::string::npos) << warned("1000");
  EXPECT_EQ(warned("100"), "");
  EXPECT_EQ(warned("4-1000"), "") << "it is as short as it has to be";
}

TEST_F(CommandLine, EveryProgramHelps) {
  for (const char* name : {"world_sim", "haptic_sim", "device_sim", "gui_headless"}) {
    const Ended ended = finish({program(name), "--help"});
    EXPECT_EQ(ended.code, 0);
    EXPECT_NE(ended.out.find(std::string("Usage: ") + name), std::string::npos) << ended.out;
    EXPECT_NE(ended.out.find("--domain"), std::string::npos);
    EXPECT_NE(ended.out.find(std::string("\n  ") + name + " heap"), std::string::npos) << ended.out;
  }
  for (const Words& command : {Words{}, Words{"run"}, Words{"plan"}}) {
    Words words{program("subworld")};
    words.insert(words.end(), command.begin(), command.end());
    words.emplace_back("--help");
    const Ended ended = finish(words);
    EXPECT_EQ(ended.code, 0);
    EXPECT_NE(ended.out.find("Usage: subworld"), std::string::npos) << ended.out;
    EXPECT_NE(ended.out.find("\n  subworld run heap "), std::string::npos) << ended.out;
  }
}

TEST_F(CommandLine, HelpIsACommandToo) {
  EXPECT_EQ(finish({program("subworld"), "help"}).out, finish({program("subworld"), "--help"}).out);
  EXPECT_EQ(finish({program("subworld"), "help", "run"}).out, finish({program("subworld"), "run", "--help"}).out);
}

// Files that a run opens do not become its standard streams.
TEST_F(CommandLine, ARunRecordsWhereTheStandardStreamsAreClosed) {
  const std::string command =
      "exec \"$0\" run press --mode lockstep --duration 0.2 --out \"$1\" --record "
      "\"$1.mcap\" --domain \"$2\" <&- >&- 2>&-";
  EXPECT_EQ(finish({"/bin/sh", "-c", command, program("subworld"), out(), domain_.text()}).code, 0);
  EXPECT_EQ(summary()["verdict"], "ok");
  EXPECT_GT(std::filesystem::file_size(out() + ".mcap"), 10000U);
}

TEST_F(CommandLine, APlanNamesItsReasons) {
  const Ended ended = finish({program("subworld"), "plan", scene("row")});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("scheme reduced"), std::string::npos) << "the default: " << ended.out;
  EXPECT_NE(ended.out.find("here 50 iterations"), std::string::npos) << "those of the scene: " << ended.out;
  EXPECT_TRUE(running(folder_.path()).empty());
}

TEST_F(CommandLine, APlanListsOptimisationsAndTakesDisable) {
  const auto planned = [&](const Words& flags) {
    Words words{program("subworld"), "plan", scene("row")};
    words.insert(words.end(), flags.begin(), flags.end());
    const Ended ended = finish(words);
    EXPECT_EQ(ended.code, 0) << ended.err;
    const std::size_t needed = ended.out.find("needed:");
    EXPECT_NE(needed, std::string::npos) << ended.out;
    return std::pair(ended.out.substr(0, needed), ended.out.substr(needed));
  };
  const auto [out, in] = planned({});
  for (const char* item :
       {"rest ", "sway ", "impulses ", "pairs ", "device ", "changes ", "overruled ", "suppression ", "energy_bound "})
    EXPECT_NE(out.find(item), std::string::npos) << item;
  EXPECT_NE(in.find("friction "), std::string::npos) << "the row has some: " << in;
  const auto [fewer, more] = planned({"--disable", "rest,energy_bound"});
  EXPECT_EQ(fewer.find("rest "), std::string::npos) << fewer;
  EXPECT_NE(more.find("as --disable says"), std::string::npos) << more;
}

TEST_F(CommandLine, APlanAdvisesWhereTheWorldCannotKeepUp) {
  EXPECT_EQ(finish({program("subworld"), "plan", scene("row")}).out.find("advice:"), std::string::npos);
  EXPECT_NE(finish({program("subworld"), "plan", scene("basin")}).out.find("advice: while all bodies move"),
            std::string::npos);
}

TEST_F(CommandLine, AnotherEngineDropsTheLongestSubStepOfTheScene) {
  const std::string part = "here sub-steps of at most 4.2 ms";
  const std::string file = edited("press", "iterations: 50}", "longest_substep_s: 0.0042}");
  EXPECT_NE(finish({program("subworld"), "plan", file}).out.find(part), std::string::npos);
  EXPECT_EQ(finish({program("subworld"), "plan", file, "--engine", "ode"}).out.find(part), std::string::npos);
}

TEST_F(CommandLine, APlanNamesItsEngines) {
  const Ended ended =
      finish({program("subworld"), "plan", scene("row"), "--engine", "ode", "--set", "haptic.preset=quality"});
  EXPECT_EQ(ended.code, 0) << ended.err;
  for (const char* part : {"world: engine ode (ODE", "sub-worlds: engine bullet (Bullet", "double precision", "zlib",
                           "preset fast", "preset quality", "friction impulses exact", "checkpoint"}) {
    EXPECT_NE(ended.out.find(part), std::string::npos) << part << " is not in: " << ended.out;
  }
}

TEST_F(CommandLine, APlanWarnsOfBoxesThatAnEngineDoesNotHold) {
  const auto warned = [&](const char* file, const char* engine) {
    const Ended ended = finish({program("subworld"), "plan", scene(file), "--engine", engine});
    EXPECT_EQ(ended.code, 0) << ended.err;
    return ended.err.find("world.length_unit_m: 0.1") != std::string::npos;
  };
  EXPECT_FALSE(warned("card_house", "bullet"));
  // Havok is the only engine with such a limit, and it is not in every build.
  const Ended asked = finish({program("subworld"), "plan", scene("row"), "--engine", "havok"});
  if (asked.err.find("not in this build") != std::string::npos) return;
  EXPECT_TRUE(warned("card_house", "havok"));
  EXPECT_FALSE(warned("row", "havok"));
}

TEST_F(CommandLine, APlanRefusesWhatARunWould) {
  const std::vector<std::pair<Words, Words>> wrong{{{"--engine", "havoc"}, {"havoc", "bullet", "ode"}},
                                                   {{"--haptic-engine", "havoc"}, {"havoc", "bullet", "ode"}},
                                                   {{"--set", "world.preset=best"}, {"best", "fast", "quality"}},
                                                   {{"--set", "haptic.preset=best"}, {"best", "fast", "quality"}}};
  for (const auto& [flags, fragments] : wrong) {
    Words words{program("subworld"), "plan", scene("row")};
    words.insert(words.end(), flags.begin(), flags.end());
    const Ended ended = finish(words);
    EXPECT_EQ(ended.code, 2) << flags.front();
    EXPECT_EQ(ended.out, "") << "half a plan was printed";
    expect_says(ended, fragments);
  }
}

TEST_F(CommandLine, AMissingVendorIsAMiddlewareErrorWithTheCure) {
  const std::string empty = folder_.path() + "/empty";
  std::filesystem::create_directory(empty);
  for (const char* dds : {"fastdds", "cyclonedds"}) {
    const Ended ended = run(scene("press"), {"--dds", dds}, {{"SUBWORLD_PLUGIN_DIR", empty}});
    EXPECT_EQ(ended.code, 3);
    expect_says(ended, {std::string("libsubworld_") + dds + ".so", "not found", "SUBWORLD_PLUGIN_DIR"});
  }
}

TEST_F(CommandLine, ADomainIsForOneRun) {
  const std::string elsewhere = folder_.path() + "/second";
  std::filesystem::create_directory(elsewhere);
  Process first(run_words(scene("press"), {"--duration", "1000"}), folder_.path(), {{"TMPDIR", elsewhere}});
  ASSERT_TRUE(eventually([&] { return running(out()).size() >= 4; }));
  Process second({program("subworld"), "run", scene("press"), "--domain", domain_.text(), "--out", elsewhere + "/out"},
                 elsewhere);
  EXPECT_EQ(second.wait(), 3);
  expect_says({3, "", second.err()},
              {"domain " + domain_.text() + " is in use by subworld (process " + std::to_string(first.pid()) + ")",
               "--domain"});
  EXPECT_GE(running(out()).size(), 4U) << "the first run was disturbed";
  first.signal(SIGTERM);
  EXPECT_EQ(first.wait(), 0);
}

TEST_F(CommandLine, AFolderIsForOneRunAndHoldsItsResultsAlone) {
  const Words short_run{program("subworld"), "run", scene("lift"), "--out", out(), "--duration", "0.05"};
  {
    Process first(run_words(scene("press"), {"--duration", "1000"}), folder_.path());
    ASSERT_TRUE(eventually([&] { return running(out()).size() >= 4; }));
    const Ended second = finish(short_run);
    EXPECT_EQ(second.code, 2);
    expect_says(second, {"--out " + out(), "another run"});
    first.signal(SIGTERM);
    EXPECT_EQ(first.wait(), 0);
  }
  ASSERT_EQ(finish(short_run).code, 0);
  EXPECT_TRUE(std::filesystem::exists(out() + "/haptic_1.csv"));
  folder_.write("out/notes.txt", "");
  ASSERT_EQ(run(scene("press"), {"--duration", "0.05"}).code, 0);
  EXPECT_FALSE(std::filesystem::exists(out() + "/haptic_1.csv")) << "of the run before";
  EXPECT_FALSE(std::filesystem::exists(out() + "/logs/haptic_sim_1.log"));
  EXPECT_TRUE(std::filesystem::exists(out() + "/notes.txt")) << "a file of the user";
}

TEST_F(CommandLine, AFileThatNoRunHasMadeIsNotReplaced) {
  const std::string mine = folder_.write("mine.yaml", "name: mine\n");
  for (const char* flag : {"--record", "--trace"}) {
    const Ended ended = run(scene("press"), {"--duration", "0.05", flag, mine});
    EXPECT_EQ(ended.code, 2);
    expect_says(ended, {flag, mine, "another name"});
    EXPECT_EQ(read_text(mine), "name: mine\n");
  }
}

TEST_F(CommandLine, ARecordingIsForOneRunAndStaysWhereARunIsRefused) {
  const std::string file = folder_.path() + "/run.mcap";
  Process first(run_words(scene("press"), {"--duration", "1000", "--record", file}), folder_.path());
  ASSERT_TRUE(eventually([&] { return running(out()).size() >= 4; }));
  const std::string other = folder_.path() + "/other";
  const Ended same_file = finish({program("subworld"), "run", scene("lift"), "--out", other, "--record", file});
  EXPECT_EQ(same_file.code, 2);
  expect_says(same_file, {file, "another run"});
  const std::string kept = folder_.write("kept.mcap", "\x89MCAP0 an earlier one");
  const Ended same_domain =
      finish({program("subworld"), "run", scene("lift"), "--domain", domain_.text(), "--out", other, "--record", kept});
  EXPECT_EQ(same_domain.code, 3);
  EXPECT_EQ(read_text(kept), "\x89MCAP0 an earlier one");
  first.signal(SIGTERM);
  EXPECT_EQ(first.wait(), 0);
}

TEST_F(CommandLine, RunsOfOneSecondHaveAFolderEach) {
  const Words words{
      "/bin/sh", "-c",
      "cd " + folder_.path() + " && exec " + program("subworld") + " run " + scene("press") + " --duration 0.05"};
  std::vector<std::unique_ptr<Process>> runs;
  for (int i = 0; i < 3; ++i) runs.push_back(std::make_unique<Process>(words, folder_.path()));
  for (auto& one : runs) EXPECT_EQ(one->wait(), 0) << one->err();
  int folders = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path() + "/out")) {
    ++folders;
    EXPECT_TRUE(std::filesystem::exists(entry.path() / "summary.json")) << entry.path();
  }
  EXPECT_EQ(folders, 3);
}

TEST_F(CommandLine, AnInterfaceHasANameOrAnAddress) {
  EXPECT_EQ(run(scene("press"), {"--duration", "0.05", "--interface", "lo"}).code, 0);
  const Ended wrong = run(scene("press"), {"--duration", "0.05", "--interface", "nosuch0"});
  EXPECT_EQ(wrong.code, 3);
  expect_says(wrong, {"--interface nosuch0", "ip -brief address"});
}

// An interface that has an address and is down, in a network of its own.
TEST_F(CommandLine, AnInterfaceThatIsDownIsRefused) {
  Words words{"/usr/bin/env",
              "unshare",
              "--map-root-user",
              "--net",
              "/bin/sh",
              "-c",
              "ip address add 192.0.2.9/24 dev lo && exec \"$@\"",
              "sh"};
  Words probe = words;
  probe.emplace_back("true");
  if (finish(probe).code != 0) GTEST_SKIP() << "unshare and ip are not permitted here";
  for (const char* dds : {"fastdds", "cyclonedds"}) {
    Words refused = words;
    const Words run = run_words(scene("press"), {"--duration", "0.05", "--dds", dds, "--interface", "192.0.2.9"});
    refused.insert(refused.end(), run.begin(), run.end());
    const Ended ended = finish(refused);
    EXPECT_EQ(ended.code, 3);
    expect_says(ended, {"--interface 192.0.2.9: is not running", "ip -brief link"});
  }
}

// Loopback reaches no other host: what would wait in vain is refused.
TEST_F(CommandLine, PeersNeedAnInterface) {
  for (const Words& more : {Words{}, Words{"--interface", "lo"}}) {
    Words flags{"--duration", "0.05", "--peers", "10.77.0.9"};
    flags.insert(flags.end(), more.begin(), more.end());
    const Ended ended = run(scene("press"), flags);
    EXPECT_EQ(ended.code, 3);
    expect_says(ended, {"--peers 10.77.0.9", "--interface", "this host only"});
  }
  EXPECT_EQ(run(scene("press"), {"--duration", "0.05", "--peers", "127.0.0.1"}).code, 0);
}

// In real time the network between hosts may delay messages: the plan says so, as the device does.
TEST_F(CommandLine, PeersBoundTheEnergyOfTheDevice) {
  const auto planned = [&](const Words& flags) {
    Words words{program("subworld"), "plan", "row", "--mode", "realtime"};
    words.insert(words.end(), flags.begin(), flags.end());
    const std::string out = finish(words).out;
    return out.find("energy_bound ") > out.find("needed:");
  };
  EXPECT_FALSE(planned({}));
  EXPECT_TRUE(planned({"--peers", "10.77.0.9", "--interface", "eth0"}));
  EXPECT_FALSE(planned({"--peers", "10.77.0.9", "--interface", "eth0", "--passivity", "off"}));
}

TEST_F(CommandLine, UsersOfSeveralVendorsAreNoMistake) {
  const Ended ended = run(scene("lift"), {"--mode", "realtime", "--duration", "0.3", "--dds", "mixed"});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(ended.out.find("PARTITION"), std::string::npos) << ended.out;
}

TEST_F(CommandLine, AFolderThatCannotBeMadeIsNamedWithTheCure) {
  const std::string file = folder_.write("file", "");
  for (const std::string& where : {file, file + "/sub", std::string("/proc/none")}) {
    const Ended ended = finish(
        {program("subworld"), "run", scene("press"), "--domain", domain_.text(), "--duration", "0.1", "--out", where});
    EXPECT_EQ(ended.code, 1);
    expect_says(ended, {where, "--out"});
  }
}

TEST_F(CommandLine, ALoneProgramNamesWhatIsMissing) {
  const std::vector<std::pair<std::string, std::string>> lone{{"haptic_sim", "start world_sim"},
                                                              {"device_sim", "start world_sim"},
                                                              {"world_sim", "start haptic_sim --user 0"},
                                                              {"gui_headless", "start world_sim"}};
  std::vector<std::unique_ptr<TestDomain>> domains;
  std::vector<std::unique_ptr<Process>> programs;
  for (const auto& [name, cure] : lone) {
    domains.push_back(std::make_unique<TestDomain>());
    const std::string own = folder_.path() + "/" + name;
    std::filesystem::create_directory(own);
    programs.push_back(std::make_unique<Process>(
        Words{program(name), scene("press"), "--wait", "1", "--domain", domains.back()->text(), "--out", own}, own));
  }
  for (std::size_t i = 0; i < lone.size(); ++i) {
    const auto& [name, cure] = lone[i];
    const Ended ended{programs[i]->wait().value_or(-1), programs[i]->out(), programs[i]->err()};
    EXPECT_EQ(ended.code, 1) << name;
    expect_says(ended,
                {name + ": error:", cure, "domain " + domains[i]->text(), "within 1 s", "--peers", "--interface"});
  }
}

TEST_F(CommandLine, AReaderThatLeavesStopsNoRun) {
  const Words words = run_words(scene("press"), {"--duration", "0.2"});
  std::string line;
  for (const std::string& word : words) line += "'" + word + "' ";
  const Ended ended = finish({"/bin/sh", "-c", line + "| true; exit 0"});
  EXPECT_TRUE(eventually([&] { return running(out()).empty(); }));
  EXPECT_EQ(summary()["verdict"], "ok") << ended.err;
}

}  // namespace
}  // namespace subworld::test

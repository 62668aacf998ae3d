#include "process/process_test.hpp"

#include <filesystem>
#include <regex>

namespace subworld::test {
namespace {

namespace fs = std::filesystem;

/// The unit of systemd and the container file.
class Packaging : public ProcessTest {
 protected:
  static std::string root() { return fs::canonical(std::string(SCENES_FOLDER) + "/../..").string(); }
  static std::string unit() { return read_text(root() + "/deploy/systemd/subworld-session@.service"); }
  /// `text` with each of `from` replaced.
  static std::string replaced(std::string text, const std::string& from, const std::string& to) {
    EXPECT_NE(text.find(from), std::string::npos) << from;
    for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
      text.replace(at, from.size(), to);
    return text;
  }
};

TEST_F(Packaging, SystemdAcceptsTheUnit) {
  if (!fs::exists("/usr/bin/systemd-analyze")) FAIL() << "systemd is not installed; tests/run installs it";
  // With the program of this build, and a user that exists.
  const std::string here =
      replaced(replaced(unit(), "/usr/bin/subworld", program("subworld")), "User=subworld", "User=root");
  const Ended ended =
      finish({"/usr/bin/systemd-analyze", "verify", "--man=no", folder_.write("subworld-session@left.service", here)});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(ended.err.find("subworld-session"), std::string::npos) << ended.err;
}

TEST_F(Packaging, TheUnitRunsAHostOfASession) {
  const Ended ended = finish({program("subworld"), "up", "three_hosts", "--host", "middle", "--out", out()});
  EXPECT_NE(unit().find("up ${SESSION} --host %i --out "), std::string::npos) << "the command line above is the unit's";
  EXPECT_NE(ended.err.find("it has world, left, right"), std::string::npos) << ended.err;
}

TEST_F(Packaging, TheContainerFileInstallsThePackageThatItBuilds) {
  const std::string text = read_text(root() + "/deploy/Containerfile");
  EXPECT_NE(text.find("deploy/build && cd build/release && cpack -B /packages"), std::string::npos) << text;
  EXPECT_NE(text.find("apt-get install -y --no-install-recommends /tmp/subworld_*.deb"), std::string::npos) << text;
}

/// What `cmake --install` makes, in another folder than that of the installation.
class Installed : public ProcessTest {
 protected:
  void SetUp() override {
    const Ended ended = finish(
        {"/usr/bin/cmake", "--install", std::string(PROGRAMS_FOLDER) + "/..", "--prefix", folder_.path() + "/first"});
    ASSERT_EQ(ended.code, 0) << ended.err;
    fs::rename(folder_.path() + "/first", place_);
  }
  const std::string place_ = folder_.path() + "/moved";
};

TEST_F(Installed, RunsASceneByItsNameWithoutTheCheckout) {
  const Ended ended =
      finish({"/usr/bin/unshare", "-m", "/bin/sh", "-c", "mount -t tmpfs none \"$0\" && cd / && exec env -i \"$@\"",
              SOURCE_FOLDER, place_ + "/bin/subworld", "run", "first", "--duration", "0.3", "--mode", "lockstep",
              "--gui", "--domain", domain_.text(), "--out", out()});
  if (ended.err.starts_with("unshare:") || ended.err.starts_with("mount:")) GTEST_SKIP() << "needs root and namespaces";
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(summary()["verdict"], "ok");
  EXPECT_TRUE(fs::exists(out() + "/picture.png"));
  // The vendor's settings are those beside the programs.
  EXPECT_NE(summary().dump().find(place_ + "/lib/subworld/qos/fastdds.xml"), std::string::npos);
}

TEST_F(Installed, HasWhatItsPagesLinkTo) {
  static const std::regex kLink(R"(\]\(([^)#:\s]+)[)#])");
  int found = 0;
  for (const auto& entry : fs::recursive_directory_iterator(place_ + "/share/doc/subworld")) {
    if (entry.path().extension() != ".md") continue;
    const std::string text = read_text(entry.path());
    for (std::sregex_iterator link(text.begin(), text.end(), kLink), end; link != end; ++link, ++found)
      EXPECT_TRUE(fs::exists(entry.path().parent_path() / (*link)[1].str())) << entry.path() << ": " << (*link)[1];
  }
  EXPECT_GT(found, 100);
}

TEST_F(Installed, NamesTheLicencesOfAllItsParts) {
  const std::string text = read_text(place_ + "/share/doc/subworld/copyright");
  for (const char* part : {"Apache License", "three 0.", "uplot 1.", "The MIT License"})
    EXPECT_NE(text.find(part), std::string::npos) << part;
}

TEST_F(Installed, HasPagesForManAndCompletesItsCommands) {
  for (const char* name : {"subworld", "world_sim", "haptic_sim", "device_sim", "gui_headless"}) {
    const Ended page = finish({"/usr/bin/man", "-l", "--warnings", place_ + "/share/man/man1/" + name + ".1"},
                              {{"MANWIDTH", "200"}, {"LC_ALL", "C.UTF-8"}});
    EXPECT_EQ(page.code, 0);
    EXPECT_EQ(page.err, "");
    EXPECT_NE(page.out.find("--scheme <TEXT>\n"), std::string::npos) << page.out;
    EXPECT_EQ(page.out.find("--duration 20 --gui"), page.out.rfind("--duration 20 --gui")) << "an example twice";
    EXPECT_TRUE(fs::exists(place_ + "/share/bash-completion/completions/" + name));
  }
  const auto completed = [&](const std::string& words) {
    const Ended ended = finish({"/bin/bash", "-c",
                                "bash -n \"$0\" && . \"$0\" && COMP_WORDS=(" + words +
                                    ") && COMP_CWORD=$((${#COMP_WORDS[@]} - 1)) && _subworld && echo ${COMPREPLY[*]}",
                                place_ + "/share/bash-completion/completions/subworld"},
                               {{"PATH", place_ + "/bin:/usr/bin:/bin"}});
    EXPECT_EQ(ended.err, "");
    return ended.out;
  };
  EXPECT_EQ(completed("subworld con"), "control\n");
  EXPECT_EQ(completed("subworld run he"), "heap heap_press heavy_outside\n");
  EXPECT_EQ(completed("subworld run heap --mode ''"), "lockstep realtime\n");
  EXPECT_EQ(completed("subworld lab coupling --quic"), "--quick\n");
  EXPECT_EQ(completed("world_sim row --haptic-e"), "--haptic-engine\n");
  EXPECT_EQ(completed("subworld run heap --out ''"), "\n") << "then bash completes names of files";
}

}  // namespace
}  // namespace subworld::test

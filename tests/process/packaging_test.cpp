#include "process/process_test.hpp"

#include <filesystem>

namespace subworld::test {
namespace {

namespace fs = std::filesystem;

/// The unit of systemd and the container file, which name files of the checkout.
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
  /// Each file in `text` that lies in the checkout's place, /opt/subworld.
  static void expect_files_exist(const std::string& text) {
    const std::string place = "/opt/subworld/";
    for (std::size_t at = text.find(place); at != std::string::npos; at = text.find(place, at + 1)) {
      const std::size_t begin = at + place.size();
      const std::string file = text.substr(begin, text.find_first_of(" \"\n", begin) - begin);
      EXPECT_TRUE(fs::exists(root() + "/" + file)) << file;
    }
  }
};

TEST_F(Packaging, SystemdAcceptsTheUnit) {
  if (!fs::exists("/usr/bin/systemd-analyze")) FAIL() << "systemd is not installed; tests/run installs it";
  // With the place of this checkout, and a user that exists.
  const std::string here = replaced(replaced(unit(), "/opt/subworld", root()), "User=subworld", "User=root");
  const Ended ended =
      finish({"/usr/bin/systemd-analyze", "verify", "--man=no", folder_.write("subworld-session@left.service", here)});
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(ended.err.find("subworld-session"), std::string::npos) << ended.err;
}

TEST_F(Packaging, TheUnitRunsAHostOfASession) {
  expect_files_exist(unit());
  const Ended ended = finish({program("subworld"), "up", "three_hosts", "--host", "middle", "--out", out()});
  EXPECT_NE(unit().find("up ${SESSION} --host %i --out "), std::string::npos) << "the command line above is the unit's";
  EXPECT_NE(ended.err.find("it has world, left, right"), std::string::npos) << ended.err;
}

TEST_F(Packaging, TheContainerFileNamesFilesThatExist) {
  const std::string text = read_text(root() + "/deploy/Containerfile");
  expect_files_exist(text);
  EXPECT_NE(text.find("RUN rm -rf build && deploy/build &&"), std::string::npos) << text;
  EXPECT_TRUE(fs::exists(root() + "/deploy/build"));
}

}  // namespace
}  // namespace subworld::test

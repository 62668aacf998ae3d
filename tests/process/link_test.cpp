#include "process/process_test.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <regex>

namespace subworld::test {
namespace {

class Link : public ProcessTest {
 protected:
  void SetUp() override {
    const Ended ended = finish({program("subworld"), "link", "--duration", "0.1"});
    if (ended.code == 0) return;
    for (const char* right : {"Operation not permitted", "/dev/net/tun"}) {
      if (ended.err.find(right) != std::string::npos)
        GTEST_SKIP() << "network namespaces are not permitted here: " << ended.err;
    }
    FAIL() << ended.err;
  }
  [[nodiscard]] Words link_words(const Words& more) const {
    Words words{program("subworld"), "link"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
};

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST_F(Link, AValidationComparesTheRequestWithTheLink) {
  const Ended ended = finish({program("link_check"), "2", "delay 8ms 2ms loss gemodel 2% 25%"});
  for (const char* part : {"delay mean", "jitter", "loss", "lost in a row", "duplicates", "out of order",
                           "100 Mbit/s: CPU", "requested", "measured", "verdict: "})
    EXPECT_TRUE(contains(ended.out, part)) << part << " is not in: " << ended.out;
  // A busy machine may delay packets; what it cannot do is change which are lost.
  const std::regex loss(R"( loss +\d+\.\d+ +\d+\.\d+ .* ok\n)");
  EXPECT_TRUE(std::regex_search(ended.out, loss)) << ended.out;
  EXPECT_TRUE(ended.code == 0 || ended.code == 4) << ended.err;
  EXPECT_EQ(contains(ended.out, "MISSED"), ended.code == 4);
}

TEST_F(Link, CommandsSeeTheirHostAndSendOverTheLink) {
  const std::string seen = folder_.path() + "/seen";
  const Ended ended = finish(link_words({"delay", "2ms", "--on-a", "cat /proc/net/route > " + seen, "--on-b",
                                         "bash -c 'for i in 1 2 3; do echo x > /dev/udp/10.9.0.1/5000; done'"}));
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_TRUE(contains(read_text(seen), "eth0")) << read_text(seen);
  EXPECT_TRUE(std::regex_search(ended.out, std::regex("b -> a: [1-9]"))) << ended.out;
}

TEST_F(Link, AFailedCommandIsNamedWithItsHost) {
  const Ended ended = finish(link_words({"--on-b", "exit 3"}));
  EXPECT_EQ(ended.code, 1);
  EXPECT_TRUE(contains(ended.err, "host b ended with exit code 3")) << ended.err;
}

TEST_F(Link, AHostCanBeEnteredUntilASignalEndsTheLink) {
  Process link(link_words({"wifi", "--on-b", "exec sleep 60.125"}), folder_.path());
  ASSERT_TRUE(eventually([&] { return contains(link.out(), "delay 15ms") && contains(link.out(), "host b: "); }));
  std::smatch path;
  const std::string text = link.out();
  ASSERT_TRUE(std::regex_search(text, path, std::regex(R"(host a: .*nsenter --net=(\S+) )"))) << text;
  EXPECT_EQ(::access(path[1].str().c_str(), F_OK), 0);
  link.signal(SIGTERM);
  EXPECT_EQ(link.wait(), 0) << link.err();
  EXPECT_TRUE(running("60.125").empty()) << "the commands end with the link";
}

TEST_F(Link, ARunOverALinkHasTheHashOfOneHost) {
  ASSERT_EQ(run(scene("press"), {"--mode", "lockstep", "--duration", "0.1"}).code, 0);
  const std::string network =
      scene("press") + " --duration 0.1 --domain " + domain_.text() + " --interface eth0 --peers ";
  const std::string folder = folder_.path();
  const Ended ended = finish(
      link_words({"delay", "2ms", "1ms", "loss", "1%", "--on-a",
                  "exec " + program("world_sim") + " " + network + "10.9.0.2 --out " + folder + "/a", "--on-b",
                  program("haptic_sim") + " " + network + "10.9.0.1 --user 0 --out " + folder + "/b & " +
                      program("device_sim") + " " + network + "10.9.0.1 --user 0 --out " + folder + "/b; wait"}));
  EXPECT_EQ(ended.code, 0) << ended.err;
  const Json world = Json::parse(read_text(folder + "/a/world.json"), nullptr, false);
  ASSERT_TRUE(world.contains("state_hash")) << ended.err;
  EXPECT_EQ(world["state_hash"], summary()["state_hash"]);
}

TEST_F(Link, WrongWordsAreNamed) {
  const std::vector<std::pair<Words, std::string>> wrong{{{"wify"}, "did you mean wifi?"},
                                                         {{"delay", "20"}, "delay 20ms"},
                                                         {{"--hosts", "1"}, "2 to 8"},
                                                         {{"--on-c", "true"}, "raise --hosts"}};
  for (const auto& [words, part] : wrong) {
    const Ended ended = finish(link_words(words));
    EXPECT_EQ(ended.code, 2) << words.front();
    EXPECT_TRUE(contains(ended.err, part)) << ended.err;
  }
}

}  // namespace
}  // namespace subworld::test

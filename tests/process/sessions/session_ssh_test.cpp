#include "process/sessions/sessions.hpp"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <filesystem>
#include <optional>
#include <set>

namespace subworld::test {
namespace {

namespace fs = std::filesystem;

TEST_F(SessionsByShell, StartDistantProgramsAndBringTheirResultsBack) {
  make_checkout(home("user@10.0.0.2") + "/subworld");
  make_checkout(home("user@10.0.0.3") + "/subworld", "/lib/subworld");  // an installation
  const Ended ended = finish(up(session(), out(), {"--ssh", ssh()}));
  EXPECT_EQ(ended.code, 0) << ended.err << ended.out;
  EXPECT_EQ(summary()["verdict"], "ok");
  EXPECT_TRUE(fs::exists(out() + "/haptic_1.csv")) << "the histories come with the results";
  EXPECT_EQ(summary()["state_hash"], hash_of_one_host());
}

TEST_F(SessionsByShell, MeasureTheOffsetsOfTheWallClocks) {
  for (const char* user : {"user@10.0.0.2", "user@10.0.0.3"}) make_checkout(home(user) + "/subworld");
  // The clock of the right host is 1000 s ahead.
  (void)write_script("date", "expr $(/bin/date \"$@\") + 1000000000000");
  const std::string shell = write_script(
      "ssh_there", "case \"$*\" in *10.0.0.3*) PATH=" + folder_.path() + ":$PATH;; esac\nexec " + ssh() + " \"$@\"");
  const Ended ended = finish(up(session(), out(), {"--ssh", shell}));
  ASSERT_EQ(ended.code, 0) << ended.err << ended.out;
  const Json hosts = summary()["hosts"];
  ASSERT_EQ(hosts.size(), 3U);
  for (const Json& host : hosts) {
    const double ahead_s = host["host"] == "right" ? 1000.0 : 0.0, uncertainty_s = host["clock_uncertainty_s"];
    EXPECT_NEAR(host["clock_offset_s"].get<double>(), ahead_s, uncertainty_s + 1e-9) << host;
  }
  EXPECT_EQ(hosts[0]["clock_uncertainty_s"], 0.0) << "the launcher's own host: " << hosts;
  EXPECT_GT(hosts[2]["clock_uncertainty_s"], 0.0) << hosts;
}

TEST_F(SessionsByShell, NeedAHostThatAnswers) {
  const std::string dead = write_script("ssh", "echo 'ssh: connect to host 10.0.0.2: No route to host' >&2; exit 255");
  const Ended ended = finish(up(session(), out(), {"--ssh", dead}));
  EXPECT_EQ(ended.code, 1) << ended.err;
  EXPECT_NE(ended.err.find("No route to host"), std::string::npos) << "what ssh says is shown: " << ended.err;
  EXPECT_NE(ended.err.find("host left: no connection to user@10.0.0.2"), std::string::npos) << ended.err;
  EXPECT_NE(ended.err.find("ConnectTimeout=10 'user@10.0.0.2' 'true'"), std::string::npos) << ended.err;
}

TEST_F(SessionsByShell, NeedPrograms) {
  make_checkout(home("user@10.0.0.2") + "/subworld");
  fs::create_directories(home("user@10.0.0.3") + "/subworld");
  const Ended ended = finish(up(session(), out(), {"--ssh", ssh()}));
  EXPECT_EQ(ended.code, 1) << ended.err;
  EXPECT_NE(ended.err.find("host right: user@10.0.0.3 has no world_sim in the folder \"subworld\""), std::string::npos)
      << ended.err;
}

/// A port of loopback that nothing uses.
int free_port() {
  const int file = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  (void)bind(file, reinterpret_cast<sockaddr*>(&address), size);
  (void)getsockname(file, reinterpret_cast<sockaddr*>(&address), &size);
  close(file);
  return ntohs(address.sin_port);
}

/// The hosts left and right are logins on this machine, by a server of ssh with keys and a configuration of its own.
class SessionsBySsh : public Sessions {
 protected:
  void SetUp() override {
    ASSERT_TRUE(fs::exists(kServer)) << "openssh-server is not installed; tests/run installs it";
    // A server that root starts needs this folder. Where the system's own server never ran, there is none.
    if (geteuid() == 0) fs::create_directory("/run/sshd");
    const std::string folder = folder_.path();
    for (const char* key : {"host_key", "user_key"})
      ASSERT_EQ(finish({"/usr/bin/ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", folder + "/" + key}).code, 0);
    const std::string port = std::to_string(free_port());
    const std::string configuration = folder_.write(
        "sshd_config", "Port " + port + "\nListenAddress 127.0.0.1\nHostKey " + folder + "/host_key\nPidFile none\n" +
                           "AuthorizedKeysFile " + folder + "/user_key.pub\nStrictModes no\nUsePAM no\n");
    const Ended check = finish({kServer, "-t", "-f", configuration});
    ASSERT_EQ(check.code, 0) << "a server of ssh cannot run here: " << check.err;
    fs::create_directory(folder + "/server");
    server_.emplace(Words{kServer, "-D", "-e", "-f", configuration}, folder + "/server");
    ASSERT_TRUE(eventually([&] { return server_->err().find("listening on") != std::string::npos; })) << server_->err();
    folder_.write("known_hosts", "subworld_test " + read_text(folder + "/host_key.pub"));
    const std::string of_client = folder_.write(
        "ssh_config", "HostName 127.0.0.1\nHostKeyAlias subworld_test\nPort " + port + "\nIdentitiesOnly yes\n" +
                          "IdentityFile " + folder + "/user_key\nUserKnownHostsFile " + folder + "/known_hosts\n");
    ssh_ = write_script("ssh", "exec ssh -F " + of_client + " \"$@\"");
    const Ended login = finish({ssh_, "-o", "BatchMode=yes", "left", "true"});
    ASSERT_EQ(login.code, 0) << "no login by ssh here: " << login.err << server_->err();
  }
  void TearDown() override {
    server_.reset();
    Sessions::TearDown();
  }

  [[nodiscard]] std::string session_by_ssh(const std::string& duration) const {
    std::string text = read_text(session("duration: 0.2", "duration: " + duration));
    for (const auto& [destination, host] : {std::pair{"user@10.0.0.2", "left"}, std::pair{"user@10.0.0.3", "right"}}) {
      const std::string checkout = folder_.path() + "/" + host;
      make_checkout(checkout);
      text.replace(text.find(destination), std::string(destination).size(), host + ("\n    folder: " + checkout));
    }
    return folder_.write("by_ssh.yaml", text);
  }
  /// Name of the folder of the results, also in the command lines of the programs on other hosts.
  [[nodiscard]] std::string mark() const { return fs::path(folder_.path()).filename(); }
  [[nodiscard]] std::string results() const { return folder_.path() + "/" + mark(); }
  [[nodiscard]] bool have_ended() const {
    return eventually([&] { return running("out/sessions/" + mark()).empty() && running(results()).empty(); });
  }

  static constexpr const char* kServer = "/usr/sbin/sshd";
  std::string ssh_;
  std::optional<Process> server_;
};

TEST_F(SessionsBySsh, RunOverHostsThatOneCommandLogsInto) {
  const Ended ended = finish(up(session_by_ssh("0.2"), results(), {"--ssh", ssh_}));
  EXPECT_EQ(ended.code, 0) << ended.err << ended.out;
  const Json one = Json::parse(read_text(results() + "/summary.json"));
  EXPECT_EQ(one["verdict"], "ok");
  EXPECT_EQ(one["state_hash"], hash_of_one_host());
  EXPECT_TRUE(have_ended());
}

// The launcher and each other host record their own programs.
TEST_F(SessionsBySsh, AreRecordedAndTracedInOneFile) {
  const std::string file = folder_.path() + "/run.mcap", trace = folder_.path() + "/trace.json";
  Ended ended = finish(up(session_by_ssh("0.2"), results(), {"--ssh", ssh_, "--record", file, "--trace", trace}));
  ASSERT_EQ(ended.code, 0) << ended.err << ended.out;
  const Json one = Json::parse(read_text(results() + "/summary.json")), counts = one["recording"];
  EXPECT_EQ(counts["messages_lost"], 0) << counts;
  for (const char* topic : {"/scene", "/world_state", "/user_0/device_state", "/user_0/haptic_report",
                            "/user_1/device_command", "/user_1/world_frame"})
    EXPECT_GT(counts["topics"][topic], 0) << topic;
  std::set<std::string> traced;
  for (const Json& event : Json::parse(read_text(trace), nullptr, false)) {
    if (event["name"] == "process_name") traced.insert(event["args"]["name"]);
  }
  EXPECT_EQ(traced.size(), 5U) << "not all programs are in the trace";

  const std::string hash = one["state_hash"];
  ended = finish({program("subworld"), "replay", file, "--resimulate", "--out", folder_.path() + "/again"});
  EXPECT_EQ(ended.code, 0) << ended.out << ended.err;
  EXPECT_NE(ended.out.find("state hash " + hash + ", recorded " + hash + ": equal"), std::string::npos) << ended.out;
  EXPECT_TRUE(have_ended());
}

TEST_F(SessionsBySsh, NameTheHostOfAProgramThatDied) {
  Process process(up(session_by_ssh("1000"), results(), {"--ssh", ssh_}), folder_.path());
  const std::string history = folder_.path() + "/right/out/sessions/" + mark() + "/right/haptic_1.csv";
  ASSERT_TRUE(eventually([&] { return read_text(history).size() > 10000; })) << process.err();
  for (const Running& one : running("out/sessions/" + mark() + "/right")) {
    if (one.words.front().ends_with("bin/haptic_sim")) kill(one.pid, SIGKILL);
  }
  EXPECT_EQ(process.wait(), 1) << process.err();
  EXPECT_NE(process.err().find("haptic_sim_1 on host right was killed there, or ssh lost the connection to it"),
            std::string::npos)
      << process.err();
  EXPECT_TRUE(have_ended()) << "programs still run on other hosts";
}

TEST_F(SessionsBySsh, EndOnAllHostsWithTheirCommand) {
  Process process(up(session_by_ssh("1000"), results(), {"--ssh", ssh_}), folder_.path());
  const std::string history = folder_.path() + "/right/out/sessions/" + mark() + "/right/haptic_1.csv";
  ASSERT_TRUE(eventually([&] { return read_text(history).size() > 10000; })) << process.err();
  process.signal(SIGKILL);
  EXPECT_TRUE(have_ended()) << "programs still run on other hosts";
}

}  // namespace
}  // namespace subworld::test

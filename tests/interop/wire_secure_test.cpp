#include "keys/keys.hpp"
#include "support/process.hpp"
#include "support/temporary_folder.hpp"
#include "support/wire_pairs.hpp"
#include "wire/bus.hpp"

#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/if_ether.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

namespace subworld {
namespace {

namespace files = std::filesystem;
using test::until;

void make(const files::path& folder) { make_keys({.folder = folder.string(), .users = 2}); }

/// Replaces a text in a file of any kind by one of the same length.
void edit(const files::path& file, const std::string& from, const std::string& to) {
  std::ifstream in(file, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(in), {}};
  const std::size_t at = text.find(from);
  ASSERT_NE(at, std::string::npos) << file;
  std::ofstream(file, std::ios::binary) << text.replace(at, from.size(), to);
}

void replace(const files::path& to, const files::path& by) {
  files::copy_file(by, to, files::copy_options::overwrite_existing);
}

/// The sound keys, keys of another authority, and copies of the sound ones in which something is wrong.
class KeyStore {
 public:
  KeyStore() {
    make(sound());
    make(other());
  }
  [[nodiscard]] files::path path(const std::string& name) const { return files::path(folder_.path()) / name; }
  [[nodiscard]] files::path sound() const { return path("sound"); }
  [[nodiscard]] files::path other() const { return path("other"); }
  [[nodiscard]] files::path copy(const std::string& name) const {
    files::copy(sound(), path(name), files::copy_options::recursive);
    return path(name);
  }

 private:
  TemporaryFolder folder_;
};

struct Attack {
  const char* name;
  const char* program;  ///< whose keys it uses
  /// Makes its folder, and returns it; empty: no keys.
  files::path (*prepare)(const KeyStore&);
};

const Attack kAttacks[] = {
    {"no keys", "device_sim 0", [](const KeyStore&) { return files::path(); }},
    {"another authority", "device_sim 0", [](const KeyStore& keys) { return keys.other(); }},
    {"an expired certificate", "device_sim 0",
     [](const KeyStore& keys) {
       const files::path copy = keys.copy("expired");
       std::ofstream(copy / "ca.cnf")
           << "[ca]\ndefault_ca = a\n[a]\ndatabase = index\nnew_certs_dir = .\n"
              "serial = serial\ndefault_md = sha256\npolicy = p\n[p]\ncommonName = supplied\n";
       std::ofstream(copy / "index").flush();
       const std::string words =
           "cd " + copy.string() +
           " && { openssl req -new -key device_sim_0/key.pem -subj /CN=device_sim_0 -out new && openssl ca -batch "
           "-config ca.cnf -cert authority.pem -keyfile authority_key.pem -in new -out device_sim_0/certificate.pem "
           "-startdate 20200101000000Z -enddate 20200102000000Z -rand_serial -notext; } > log 2>&1";
       EXPECT_EQ(std::system(words.c_str()), 0);
       return copy;
     }},
    {"another role's key", "device_sim 0",
     [](const KeyStore& keys) {
       const files::path copy = keys.copy("key");
       replace(copy / "device_sim_0/key.pem", copy / "device_sim_1/key.pem");
       return copy;
     }},
    {"a certificate without its key", "device_sim 1",
     [](const KeyStore& keys) {
       const files::path copy = keys.copy("certificate");
       replace(copy / "device_sim_1/certificate.pem", copy / "device_sim_0/certificate.pem");
       return copy;
     }},
    {"a certificate of another authority", "device_sim 0",
     [](const KeyStore& keys) {
       const files::path copy = keys.copy("foreign");
       for (const char* file : {"device_sim_0/certificate.pem", "device_sim_0/key.pem"})
         replace(copy / file, keys.other() / file);
       return copy;
     }},
    {"another role's permissions", "device_sim 1",
     [](const KeyStore& keys) {
       const files::path copy = keys.copy("permissions");
       replace(copy / "device_sim_1/permissions.p7s", copy / "device_sim_0/permissions.p7s");
       return copy;
     }},
    {"changed permissions", "device_sim 1",
     [](const KeyStore& keys) {
       const files::path copy = keys.copy("changed");
       edit(copy / "device_sim_1/permissions.p7s", "<partition>device_1<", "<partition>device_0<");
       return copy;
     }},
    {"permissions of another authority", "device_sim 0",
     [](const KeyStore& keys) {
       const files::path copy = keys.copy("granted");
       replace(copy / "device_sim_0/permissions.p7s", keys.other() / "device_sim_0/permissions.p7s");
       return copy;
     }},
    {"changed governance", "device_sim 0",
     [](const KeyStore& keys) {
       const files::path copy = keys.copy("governance");
       edit(copy / "governance.p7s", "<rtps_protection_kind>SIGN</", "<rtps_protection_kind>NONE</");
       return copy;
     }},
    {"governance of another authority", "device_sim 0",
     [](const KeyStore& keys) {
       const files::path copy = keys.copy("governed");
       replace(copy / "governance.p7s", keys.other() / "governance.p7s");
       return copy;
     }},
    {"the device of another user", "device_sim 1", [](const KeyStore& keys) { return keys.sound(); }},
    {"the role of a haptic process", "haptic_sim 0", [](const KeyStore& keys) { return keys.sound(); }},
    {"the role of a world", "world_sim", [](const KeyStore& keys) { return keys.sound(); }},
    {"the role of a display", "gui_headless", [](const KeyStore& keys) { return keys.sound(); }},
    {"the role of a command", "subworld control", [](const KeyStore& keys) { return keys.sound(); }},
};

/// Says again, unchanged and changed, what others say on loopback in a domain.
class Repeater {
 public:
  explicit Repeater(int domain)
      : domain_(domain),
        heard_(socket(AF_PACKET, SOCK_DGRAM, htons(ETH_P_IP))),
        said_(socket(AF_INET, SOCK_DGRAM, 0)) {}
  ~Repeater() { close(heard_), close(said_); }
  Repeater(const Repeater&) = delete;
  Repeater& operator=(const Repeater&) = delete;

  /// Returns how many messages it repeated.
  int repeat() {
    int repeated = 0;
    for (ssize_t size = 0; (size = recv(heard_, packet_.data(), packet_.size(), MSG_DONTWAIT)) > 0;) {
      const std::size_t udp = 4U * (packet_[0] & 15U), message = udp + 8;
      const auto end = static_cast<std::size_t>(size);
      if (packet_[9] != IPPROTO_UDP || end < message + 60 || std::memcmp(&packet_[message], "RTPS", 4) != 0) continue;
      if (std::memcmp(&packet_[udp], &own_port_, 2) == 0) continue;
      sockaddr_in to{.sin_family = AF_INET, .sin_port = 0, .sin_addr = {}, .sin_zero = {}};
      std::memcpy(&to.sin_port, &packet_[udp + 2], 2);
      const int first = 7400 + 250 * domain_;
      if (ntohs(to.sin_port) < first || ntohs(to.sin_port) >= first + 250) continue;  // of another test
      to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      for (int changes = 0; changes < 3; ++changes) {
        if (changes > 0) packet_[message + 20 + random_() % (end - message - 20)] ^= 1U << (random_() % 8);
        sendto(said_, &packet_[message], end - message, 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
      }
      sockaddr_in own{};
      socklen_t length = sizeof own;
      if (own_port_ == 0 && getsockname(said_, reinterpret_cast<sockaddr*>(&own), &length) == 0)
        own_port_ = own.sin_port;
      ++repeated;
    }
    return repeated;
  }
  [[nodiscard]] bool permitted() const { return heard_ >= 0; }
  /// Whether a message since the last call has these bytes.
  bool sees(std::uint64_t mark) {
    bool seen = false;
    for (ssize_t size = 0; (size = recv(heard_, packet_.data(), packet_.size(), MSG_DONTWAIT)) > 0;)
      seen |= memmem(packet_.data(), static_cast<std::size_t>(size), &mark, sizeof mark) != nullptr;
    return seen;
  }

 private:
  int domain_;
  int heard_;
  int said_;
  in_port_t own_port_ = 0;
  std::array<std::uint8_t, 65536> packet_{};
  std::minstd_rand random_;
};

class WireSecure : public ::testing::TestWithParam<Vendor> {
 protected:
  [[nodiscard]] std::unique_ptr<Bus> open(const std::string& program) const { return open(program, keys_.sound()); }
  [[nodiscard]] std::unique_ptr<Bus> open(const std::string& program, const files::path& keys) const {
    BusConfig config = test::config_of(GetParam(), domain_.number());
    config.secure = keys.string();
    config.participant_name = program;
    return open_bus(config);
  }
  KeyStore keys_;
  const test::TestDomain domain_;
};

TEST_P(WireSecure, OnlyTheDeviceIsHeardAsTheDevice) {
  const auto haptic = open("haptic_sim 0"), device = open("device_sim 0");
  auto states = haptic->reader<DeviceState>(device_partition(0));
  auto writer = device->writer<DeviceState>(device_partition(0));
  ASSERT_TRUE(until(*haptic, [&] { return states.matched() == 1 && writer.matched() == 1; }));

  // Programs of their own: a participant that fails to start harms the next one of its process.
  std::vector<std::unique_ptr<test::Process>> attackers;
  const files::path peer = files::read_symlink("/proc/self/exe").parent_path() / "hostile_peer";
  for (const Attack& attack : kAttacks) {
    const files::path out = keys_.path(std::string(attack.name) + ".out");
    files::create_directories(out);
    attackers.push_back(
        std::make_unique<test::Process>(test::Words{peer, name_of(GetParam()), domain_.text(), "lockstep", "as_device",
                                                    "3", attack.prepare(keys_), attack.program},
                                        out));
  }
  Repeater repeater(domain_.number());
  std::uint64_t sequence = 0, heard = 0;
  int repeated = 0;
  DeviceState sent, state;
  sent.sender = 1;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  while (std::chrono::steady_clock::now() < end) {
    sent.sequence = ++sequence;
    writer.write(sent);
    repeated += repeater.repeat();
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    while (states.take(state) == Take::sample) {
      ASSERT_EQ(state.sender, 1U);
      ASSERT_EQ(state.sequence, ++heard) << "nothing is heard twice, and nothing is lost";
    }
  }
  EXPECT_TRUE(until(*haptic, [&] {
    while (states.take(state) == Take::sample) ++heard;
    return heard == sequence;
  }));
  EXPECT_EQ(states.matched(), 1);
  EXPECT_EQ(haptic->events().rejected, 0U);
  EXPECT_TRUE(repeated > 100 || !repeater.permitted()) << repeated;
  for (std::size_t i = 0; i < attackers.size(); ++i) {
    const std::optional<int> code = attackers[i]->wait(20.0);
    ASSERT_TRUE(code) << kAttacks[i].name;
    const std::string out = attackers[i]->out(), err = attackers[i]->err();
    // Where the vendor lets it start, the others do not hear it. Else it says why.
    EXPECT_TRUE(*code == 0 || err.find("no writer of device_state") != std::string::npos ||
                err.find("subworld keys check") != std::string::npos)
        << kAttacks[i].name << ": " << err;
    EXPECT_EQ(*code == 0, out == "attacks\n");
  }
}

template <class M>
void publish(Bus& bus, const std::string& partition) {
  (void)bus.writer<M>(partition);
}
struct Publication {
  const char* topic;
  std::string partition;
  void (*open)(Bus& bus, const std::string& partition);
  std::vector<std::string> by;  ///< the only roles that may
};
const std::vector<std::string> kEveryone{"world_sim",    "gui_headless", "subworld control", "haptic_sim 0",
                                         "haptic_sim 1", "device_sim 0", "device_sim 1"};
const std::vector<Publication> kPublications = [] {
  std::vector<Publication> all{{"scene", "", publish<SceneDescription>, {"world_sim"}},
                               {"world_state", "", publish<WorldSnapshot>, {"world_sim"}},
                               {"control", "", publish<Control>, {"gui_headless", "subworld control"}},
                               {"control_reply", "", publish<ControlReply>, kEveryone},
                               {"status", "", publish<Status>, kEveryone}};
  for (const int user : {0, 1}) {
    const std::string haptic = "haptic_sim " + std::to_string(user), device = "device_sim " + std::to_string(user);
    all.push_back({"world_frame", user_partition(user), publish<WorldFrame>, {"world_sim"}});
    all.push_back({"haptic_report", user_partition(user), publish<HapticReport>, {haptic}});
    all.push_back({"device_command", device_partition(user), publish<DeviceCommand>, {haptic}});
    all.push_back({"device_state", device_partition(user), publish<DeviceState>, {device}});
    all.push_back({"shared_device_state",
                   device_partition(user),
                   [](Bus& bus, const std::string& partition) { (void)bus.shared_device_writer(partition, kShared_s); },
                   {device}});
  }
  return all;
}();

TEST_P(WireSecure, EachRolePublishesItsTopicsOnly) {
  for (const std::string& role : kEveryone) {
    const auto bus = open(role);
    for (const Publication& one : kPublications) {
      const std::string what = role + " publishes " + one.topic + " in \"" + one.partition + "\"";
      std::string refused;
      try {
        one.open(*bus, one.partition);
      } catch (const Error& error) {
        refused = error.what();
      }
      const bool may = std::ranges::find(one.by, role) != one.by.end();
      EXPECT_EQ(refused.empty(), may) << what << ": " << refused;
      EXPECT_TRUE(may || refused.find(std::string("no writer of ") + one.topic) != std::string::npos)
          << what << ": " << refused;
    }
  }
}

// All is signed; what the governance names is encrypted, too.
TEST_P(WireSecure, HidesTheTopicsThatAreToBeHidden) {
  constexpr std::uint64_t kMark = 0x5375'6277'6f72'6c64;
  Repeater listener(domain_.number());
  if (!listener.permitted()) GTEST_SKIP() << "needs the right to read packets";
  const files::path hidden = keys_.path("hidden");
  make_keys({.folder = hidden, .users = 1, .encrypt = {"device_state"}});
  for (const files::path& keys : {keys_.sound(), hidden}) {
    const auto haptic = open("haptic_sim 0", keys), device = open("device_sim 0", keys);
    auto states = haptic->reader<DeviceState>(device_partition(0));
    auto writer = device->writer<DeviceState>(device_partition(0));
    auto commands = device->reader<DeviceCommand>(device_partition(0));
    auto answers = haptic->writer<DeviceCommand>(device_partition(0));
    const auto met = [](const auto& reader, const auto& of) { return reader.matched() == 1 && of.matched() == 1; };
    ASSERT_TRUE(until(*haptic, [&] { return met(states, writer) && met(commands, answers); })) << keys;
    DeviceState sent, state;
    sent.sender = kMark;
    (void)listener.sees(kMark);  // discovery fills its buffer
    writer.write(sent);
    ASSERT_TRUE(until(*haptic, [&] { return states.take(state) == Take::sample; })) << keys;
    EXPECT_EQ(state.sender, kMark);
    EXPECT_EQ(listener.sees(kMark), keys == keys_.sound()) << keys;
    DeviceCommand answer, command;
    answer.served = kMark;
    answers.write(answer);
    ASSERT_TRUE(until(*device, [&] { return commands.take(command) == Take::sample; })) << keys;
    EXPECT_TRUE(listener.sees(kMark)) << "device_command is not to be hidden: " << keys;
  }
}

INSTANTIATE_TEST_SUITE_P(Vendors, WireSecure, ::testing::Values(Vendor::fastdds, Vendor::cyclonedds),
                         [](const auto& info) { return std::string(name_of(info.param)); });

TEST(Keys, FaultsAreNamed) {
  const KeyStore keys;
  EXPECT_EQ(key_faults(keys.sound().string()), std::vector<std::string>{});
  const auto says = [](const files::path& folder, const std::string& words) {
    const std::vector<std::string> faults = key_faults(folder.string());
    return std::ranges::any_of(faults, [&](const std::string& one) { return one.find(words) != std::string::npos; });
  };
  const auto attack = [&](const std::string& name) {
    return std::ranges::find(kAttacks, name, &Attack::name)->prepare(keys);
  };
  EXPECT_TRUE(says(attack("an expired certificate"), "device_sim_0: certificate.pem has expired"));
  EXPECT_TRUE(says(attack("another role's key"), "device_sim_0: key.pem does not belong"));
  EXPECT_TRUE(says(attack("a certificate without its key"), "certificate.pem is not that of device_sim_1"));
  EXPECT_TRUE(says(attack("a certificate of another authority"), "certificate.pem is not of this authority"));
  EXPECT_TRUE(says(attack("another role's permissions"), "permissions.p7s is not that of device_sim_1"));
  EXPECT_TRUE(says(attack("changed permissions"), "or was changed"));
  EXPECT_TRUE(says(attack("governance of another authority"), "governance.p7s is not signed by this authority"));
  EXPECT_THROW(make(keys.sound()), Error) << "no keys are overwritten";
  const files::path first = keys.sound() / "device_sim_0/certificate.pem";
  const auto made = files::last_write_time(first);
  make_keys({.folder = keys.sound(), .users = 3});
  EXPECT_EQ(users_with_keys(keys.sound()), 3);
  EXPECT_EQ(files::last_write_time(first), made);
  files::create_directory(keys.sound() / "logs");  // of no role
  EXPECT_EQ(key_faults(keys.sound()), std::vector<std::string>{});
  const int folder = open(keys.sound().c_str(), O_RDONLY | O_DIRECTORY);
  ASSERT_EQ(flock(folder, LOCK_EX), 0);
  EXPECT_THROW(make_keys({.folder = keys.sound(), .users = 4}), Error) << "another program makes keys there";
  close(folder);
  EXPECT_EQ(users_with_keys(keys.sound()), 3);
  files::remove(keys.sound() / "device_sim_2/permissions.p7s");  // as one that was interrupted
  for (const char* encrypt : {kAllTopics, "device_state"})
    EXPECT_THROW(make_keys({.folder = keys.sound(), .users = 3, .encrypt = {encrypt}}), Error) << "they only sign";
  make_keys({.folder = keys.sound(), .users = 3});
  EXPECT_EQ(key_faults(keys.sound()), std::vector<std::string>{});
}

}  // namespace
}  // namespace subworld

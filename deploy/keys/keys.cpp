#include "keys/keys.hpp"

#include "io/results/output.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "wire/bus.hpp"
#include "wire/plugin.hpp"
#include "wire/topics.hpp"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace subworld {
namespace {

namespace files = std::filesystem;

bool has_openssl() { return std::system("command -v openssl > /dev/null") == 0; }

/// Runs openssl in a folder; its words are those of a shell. Throws `Error` (failed) with what it says.
void must(const files::path& folder, const std::string& words) {
  const std::string command = fmt::format("cd {} && {{ openssl {}; }} > openssl.log 2>&1", shell_word(folder), words);
  if (std::system(command.c_str()) == 0) return;
  if (!has_openssl()) throw Error(ExitCode::failed, "openssl is missing; install the package openssl");
  std::ifstream log(folder / "openssl.log");
  const std::string text{std::istreambuf_iterator<char>(log), {}};
  throw Error(ExitCode::failed,
              fmt::format("{}: openssl has not ended well; the same command goes on. It says: {}\nof: openssl {}",
                          folder.string(), text, words));
}

/// The lock of a folder whose keys are being made; it ends with this object.
class BeingMade {
 public:
  /// Throws `Error` (usage) where another program makes keys there.
  explicit BeingMade(const files::path& folder) : file_(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    if (flock(file_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
      throw Error(ExitCode::usage,
                  fmt::format("{}: another program makes keys here; wait for its end", folder.string()));
  }
  ~BeingMade() { close(file_); }
  BeingMade(const BeingMade&) = delete;
  BeingMade& operator=(const BeingMade&) = delete;

 private:
  int file_;
};

void write(const files::path& file, const std::string& text) {
  if (!(std::ofstream(file) << text).flush())
    throw Error(ExitCode::failed, fmt::format("{}: cannot be written", file.string()));
}

/// Whether commands of a shell succeed in a folder, which they leave as it is.
bool holds(const files::path& folder, const std::string& commands) {
  return std::system(fmt::format("cd {} && {{ {}; }} > /dev/null 2>&1", shell_word(folder), commands).c_str()) == 0;
}

/// Signs NAME.xml of a folder as NAME.p7s; `to_all` leads to the authority's files.
void sign(const files::path& folder, const std::string& name, const std::string& text, const std::string& to_all) {
  write(folder / (name + ".xml"), text);
  must(folder, fmt::format("smime -sign -text -in {0}.xml -out {0}.p7s -signer {1}authority.pem -inkey "
                           "{1}authority_key.pem",
                           name, to_all));
}

constexpr const char* kNewKey = "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes";
constexpr const char* kHead = R"(<?xml version="1.0" encoding="utf-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_{}.xsd">
)";
// Cyclone DDS refuses a higher number.
constexpr const char* kDomains = "<domains><id_range><min>0</min><max>230</max></id_range></domains>";

std::string governance(const std::vector<std::string>& encrypted) {
  const auto topic_rule = [](const std::string& topic, const char* data) {
    return fmt::format(R"(<topic_rule><topic_expression>{}</topic_expression>
<enable_discovery_protection>true</enable_discovery_protection>
<enable_liveliness_protection>true</enable_liveliness_protection>
<enable_read_access_control>true</enable_read_access_control>
<enable_write_access_control>true</enable_write_access_control>
<metadata_protection_kind>NONE</metadata_protection_kind>
<data_protection_kind>{}</data_protection_kind></topic_rule>
)",
                       topic, data);
  };
  const bool all = encrypted == std::vector<std::string>{kAllTopics};
  std::string rules;
  for (const std::string& topic : encrypted)
    if (!all) rules += topic_rule(topic, "ENCRYPT");
  return fmt::format(kHead, "governance") + fmt::format(R"(<domain_access_rules><domain_rule>{0}
<allow_unauthenticated_participants>false</allow_unauthenticated_participants>
<enable_join_access_control>true</enable_join_access_control>
<discovery_protection_kind>{1}</discovery_protection_kind>
<liveliness_protection_kind>{1}</liveliness_protection_kind>
<rtps_protection_kind>{1}</rtps_protection_kind>
<topic_access_rules>{2}</topic_access_rules></domain_rule></domain_access_rules></dds>
)",
                                                        kDomains, all ? "ENCRYPT" : "SIGN",
                                                        rules + topic_rule("*", "NONE"));
}

/// Topics that a role publishes: those of the whole run, and those of one user, in a partition.
struct Role {
  std::string name;
  std::vector<std::string> topics;
  std::string partition = {};
  std::vector<std::string> topics_of_user = {};
  std::string second_partition = {};
  std::vector<std::string> second_topics = {};
};

std::vector<Role> roles(int users) {
  const auto name = [](const auto& spec) { return std::string(spec.name); };
  const std::string status = name(kTopicOf<Status>), reply = name(kTopicOf<ControlReply>),
                    control = name(kTopicOf<Control>), frame = name(kTopicOf<WorldFrame>);
  std::vector<Role> all{{.name = "world_sim",
                         .topics = {name(kTopicOf<SceneDescription>), name(kTopicOf<WorldSnapshot>), status, reply},
                         .partition = user_partition(0).substr(0, 5) + "*",
                         .topics_of_user = {frame}},
                        {.name = "gui_headless", .topics = {control, status, reply}},
                        {.name = "subworld", .topics = {control, status, reply}}};
  for (int user = 0; user < users; ++user) {
    all.push_back({.name = fmt::format("haptic_sim_{}", user),
                   .topics = {status, reply},
                   .partition = user_partition(user),
                   .topics_of_user = {name(kTopicOf<HapticReport>)},
                   .second_partition = device_partition(user),
                   .second_topics = {name(kTopicOf<DeviceCommand>)}});
    all.push_back({.name = fmt::format("device_sim_{}", user),
                   .topics = {status, reply},
                   .partition = device_partition(user),
                   .topics_of_user = {name(kTopicOf<DeviceState>), kSharedDeviceState.name}});
  }
  return all;
}

/// Whether a folder's name is that of a role.
bool is_role(const std::string& name) {
  const std::string start = name.substr(0, name.find_last_of('_') + 1);
  return name == "world_sim" || name == "gui_headless" || name == "subworld" || start == "haptic_sim_" ||
         start == "device_sim_";
}

std::string rule(const char* kind, const std::vector<std::string>& topics, const std::string& partition) {
  if (topics.empty()) return {};
  std::string text = fmt::format("<{}><topics>", kind);
  for (const std::string& topic : topics) text += fmt::format("<topic>{}</topic>", topic);
  text += "</topics>";
  if (!partition.empty()) text += fmt::format("<partitions><partition>{}</partition></partitions>", partition);
  return text + fmt::format("</{}>\n", kind);
}

std::string permissions(const Role& role, const std::string& from, const std::string& to) {
  const std::string publish = rule("publish", role.topics, "") + rule("publish", role.topics_of_user, role.partition) +
                              rule("publish", role.second_topics, role.second_partition);
  return fmt::format(kHead, "permissions") +
         fmt::format(R"(<permissions><grant name="{0}"><subject_name>CN={0}</subject_name>
<validity><not_before>{1}</not_before><not_after>{2}</not_after></validity>
<allow_rule>{3}
{4}{5}{6}</allow_rule>
<default>DENY</default></grant></permissions></dds>
)",
                     role.name, from, to, kDomains, publish, rule("subscribe", {"*"}, ""),
                     rule("subscribe", {"*"}, "*"));
}

const std::vector<std::string> kOfRole{"certificate.pem", "key.pem", "permissions.p7s"};

/// Whether a folder has all of these files; one that was interrupted has not.
bool is_complete(const files::path& folder, const std::vector<std::string>& names) {
  return std::ranges::all_of(names, [&](const std::string& name) {
    std::error_code ignored;
    return files::file_size(folder / name, ignored) > 0 && !ignored;
  });
}

/// In the order of topic_names(), each once.
std::vector<std::string> in_order(const std::vector<std::string>& encrypt) {
  const auto asked = [&](const std::string& topic) { return std::ranges::count(encrypt, topic) > 0; };
  if (asked(kAllTopics)) return {kAllTopics};
  std::vector<std::string> topics = topic_names();
  std::erase_if(topics, [&](const std::string& topic) { return !asked(topic); });
  return topics;
}

}  // namespace

std::vector<std::string> topic_names() {
  std::vector<std::string> names;
  for (const TopicSpec& topic : kTopics) names.emplace_back(topic.name);
  names.emplace_back(kSharedDeviceState.name);
  return names;
}

std::vector<std::string> encrypted_topics(const std::string& folder) {
  std::ifstream file(files::path(folder) / "governance.p7s");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  if (text.find("rtps_protection_kind>ENCRYPT") != std::string::npos) return {kAllTopics};
  std::vector<std::string> topics = topic_names();
  std::erase_if(topics, [&](const std::string& topic) {
    return text.find("topic_expression>" + topic + "<") == std::string::npos;
  });
  return topics;
}

int users_with_keys(const std::string& folder) {
  int users = 0;
  while (is_complete(files::path(folder) / fmt::format("haptic_sim_{}", users), kOfRole)) ++users;
  return users;
}

void make_keys(const KeysRequest& request) {
  if (request.folder.empty()) throw Error(ExitCode::usage, "names no folder for the keys");
  const files::path all = files::absolute(request.folder);
  umask(S_IRWXG | S_IRWXO);  // a key is the owner's alone
  files::create_directories(all);
  const BeingMade lock(all);
  const bool adds = is_complete(all, {"authority.pem"}), governed = is_complete(all, {"governance.p7s"});
  std::vector<Role> missing = roles(request.users);
  std::erase_if(missing, [&](const Role& role) { return adds && is_complete(all / role.name, kOfRole); });
  if (missing.empty())
    throw Error(ExitCode::usage, fmt::format("{}: has keys for {} user{} already; name another folder, or more users",
                                             all.string(), users_with_keys(all), users_with_keys(all) == 1 ? "" : "s"));
  const std::vector<std::string> encrypted = in_order(request.encrypt), before = encrypted_topics(all.string());
  if (adds && governed && encrypted != before)
    throw Error(ExitCode::usage,
                fmt::format("{}: its keys were made {}; do so again, or name another folder", all.string(),
                            before.empty() ? "without --encrypt" : "with --encrypt " + joined(before, ",")));
  if (adds && !files::is_regular_file(all / "authority_key.pem"))
    throw Error(ExitCode::usage,
                fmt::format("{}: has no authority_key.pem, which makes more keys; call this where the keys were made",
                            all.string()));
  const std::string days = std::to_string(request.days);
  if (!adds)
    must(all, fmt::format("{} -keyout authority_key.pem -out authority.pem -days {} -subj '/CN=Subworld authority'",
                          kNewKey, days));
  if (!adds || !governed) sign(all, "governance", governance(encrypted), "");
  const auto now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  constexpr std::time_t kDay = 86'400;  // clocks of hosts may differ
  const auto text = [](std::time_t time) { return fmt::format("{:%Y-%m-%dT%H:%M:%S}", fmt::gmtime(time)); };
  for (const Role& role : missing) {
    const files::path own = all / role.name;
    files::create_directories(own);
    must(own, fmt::format("{} -keyout key.pem -out certificate.pem -days {} -subj /CN={} -CA ../authority.pem -CAkey "
                          "../authority_key.pem",
                          kNewKey, days, role.name));
    sign(own, "permissions", permissions(role, text(now - kDay), text(now + kDay * request.days)), "../");
    files::remove(own / "openssl.log");
  }
  files::remove(all / "openssl.log");
}

namespace {

/// What is wrong with files of a folder, before their contents count.
void check_files(const files::path& folder, const std::vector<std::string>& names, std::vector<std::string>& faults) {
  for (const std::string& name : names) {
    const files::path file = folder / name;
    const files::file_status status = files::status(file);
    if (!files::is_regular_file(status) || access(file.c_str(), R_OK) != 0)
      faults.push_back(fmt::format("{}: is missing, or cannot be read", file.string()));
    else if (name.ends_with("key.pem") &&
             (status.permissions() & (files::perms::group_all | files::perms::others_all)) != files::perms::none)
      faults.push_back(fmt::format("{}: others may read it; chmod 600", file.string()));
  }
}

/// The words of openssl that succeed where a key belongs to a certificate.
std::string same_key(const std::string& certificate, const std::string& key) {
  return fmt::format("version && [ \"$(openssl x509 -noout -pubkey -in {})\" = \"$(openssl pkey -in {} -pubout)\" ]",
                     certificate, key);
}

}  // namespace

std::vector<std::string> key_faults(const std::string& folder, const std::vector<std::string>& roles) {
  std::vector<std::string> faults;
  if (!files::is_directory(folder)) return {fmt::format("{}: is no folder; `subworld keys make` makes one", folder)};
  const files::path all = files::absolute(folder);
  if (!has_openssl()) return {"openssl is missing, which checks keys; install the package openssl"};
  if (access(all.c_str(), R_OK | X_OK) != 0) return {fmt::format("{}: cannot be read by this user", all.string())};
  check_files(all, {"authority.pem", "governance.p7s"}, faults);
  if (!faults.empty()) return faults;
  const auto check = [&](const files::path& where, const std::string& words, const std::string& what) {
    if (holds(where, "openssl " + words)) return true;
    faults.push_back(fmt::format("{}: {}", where.string(), what));
    return false;
  };
  const std::string readable = "x509 -noout -in ", expired = "x509 -checkend 0 -noout -in ";
  if (!check(all, readable + "authority.pem", "authority.pem is no certificate")) return faults;
  check(all, expired + "authority.pem", "authority.pem has expired");
  check(all, "smime -verify -text -in governance.p7s -CAfile authority.pem",
        "governance.p7s is not signed by this authority, or was changed");
  for (const std::string& role : roles)
    if (!files::is_directory(all / role)) faults.push_back(fmt::format("{}: has no keys of {}", all.string(), role));
  if (files::is_regular_file(all / "authority_key.pem")) {
    check_files(all, {"authority_key.pem"}, faults);
    check(all, same_key("authority.pem", "authority_key.pem"), "authority_key.pem does not belong to authority.pem");
  }
  for (const auto& entry : files::directory_iterator(all)) {
    const files::path& own = entry.path();
    const std::string role = own.filename().string();
    if (!entry.is_directory() || !is_role(role)) continue;
    if (!roles.empty() && std::ranges::find(roles, role) == roles.end()) continue;
    const std::size_t before = faults.size();
    check_files(own, kOfRole, faults);
    if (faults.size() > before || !check(own, readable + "certificate.pem", "certificate.pem is no certificate"))
      continue;
    check(own, expired + "certificate.pem", "certificate.pem has expired");
    check(own, "verify -no_check_time -CAfile ../authority.pem certificate.pem",
          "certificate.pem is not of this authority");
    check(own, fmt::format("x509 -noout -subject -in certificate.pem | grep -qxE 'subject=CN ?= ?{}'", role),
          fmt::format("certificate.pem is not that of {}", role));
    check(own, same_key("certificate.pem", "key.pem"), "key.pem does not belong to certificate.pem");
    check(own,
          fmt::format("version && text=$(openssl smime -verify -text -in permissions.p7s -CAfile ../authority.pem) && "
                      "echo \"$text\" | grep -q '>CN={}<'",
                      role),
          fmt::format("permissions.p7s is not that of {}, is not signed by this authority, or was changed", role));
  }
  return faults;
}

}  // namespace subworld

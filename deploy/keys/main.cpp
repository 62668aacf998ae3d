#include "io/options/options.hpp"
#include "io/results/output.hpp"
#include "keys/keys.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "tools.hpp"

#include <fmt/core.h>

namespace {

using namespace subworld;

int main_of(int argc, char** argv) {
  CommandLine line("subworld keys", about_tool("keys"));
  KeysRequest request;
  CommandLine& make = line.command("make", "Makes the keys of a run, or adds those of further users");
  make.add("folder", &request.folder, "folder for the keys").required();
  make.add("--users", &request.users, "users of the run").range(1, 64);
  make.add("--days", &request.days, "days for which the keys are valid").range(1, 36500);
  std::vector<std::string> topics = topic_names();
  topics.insert(topics.begin(), kAllTopics);
  make.add(
          "--encrypt", &request.encrypt,
          "topics whose contents are also hidden, separated by commas; else the keys only prove who has sent a message")
      .one_of(topics)
      .implies(kAllTopics)
      .otherwise("none");
  CommandLine& check = line.command("check", "Names what is wrong with the keys of a folder");
  check.add("folder", &request.folder, "folder of the keys").required();
  std::vector<std::string> roles;
  check.add("--role", &roles, "only the keys of these roles, as haptic_sim_0, separated by commas").otherwise("all");
  line.footer(
      "Examples:\n"
      "  subworld keys make keys --users 2\n"
      "  subworld keys make keys --users 4  # adds two\n"
      "  subworld keys make hidden --encrypt device_state,device_command\n"
      "  subworld keys check keys\n"
      "  subworld run heap --secure keys");
  if (const auto code = line.parse(argc, argv)) return *code;
  if (make.chosen()) {
    make_keys(request);
    fmt::print(
        "{0}: keys for {1} user{3}, valid for {2} days\n"
        "Each host needs authority.pem, governance.p7s and the folders of its programs. Keep authority_key.pem: who "
        "has it can make more keys.\n",
        request.folder, request.users, request.days, request.users == 1 ? "" : "s");
    return static_cast<int>(ExitCode::done);
  }
  const std::vector<std::string> faults = key_faults(request.folder, roles);
  for (const std::string& fault : faults) fmt::print("{}\n", fault);
  if (faults.empty()) {
    const std::vector<std::string> encrypted = encrypted_topics(request.folder);
    fmt::print("{}: nothing is wrong\nencrypted: {}\n", request.folder,
               encrypted.empty() ? "no topic" : joined(encrypted, ", "));
  }
  return static_cast<int>(faults.empty() ? ExitCode::done : ExitCode::failed);
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::finished("subworld keys", subworld::guarded("subworld keys", [&] { return main_of(argc, argv); }));
}

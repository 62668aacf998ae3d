#pragma once

#include "doctor/facts.hpp"

#include <span>
#include <string>
#include <vector>

namespace subworld::doctor {

/// What is wrong, why it matters, and a command that cures it.
struct Finding {
  std::string check = {};  ///< name of its check
  std::string what = {};
  std::string why = {};
  std::string cure = {};  ///< as typed in the shell that `subworld doctor` was started from
};

/// Judges facts. A check reports one cause once: a fault that follows from another one is not reported.
struct Check {
  const char* name;
  const char* about;  ///< what is in order, in words
  void (*judge)(const Facts& facts, std::vector<Finding>& findings);
};

/// All checks, in the order in which causes precede their effects.
[[nodiscard]] std::span<const Check> checks();

/// All findings. Each has the name of its check.
[[nodiscard]] std::vector<Finding> judge(const Facts& facts);

/// The command line of the doctor as given, for cures that change it.
[[nodiscard]] std::string command_of(const Request& request);

/// Parts of `checks()`, by what they look at.
[[nodiscard]] std::span<const Check> machine_checks();
[[nodiscard]] std::span<const Check> installation_checks();
[[nodiscard]] std::span<const Check> network_checks();
[[nodiscard]] std::span<const Check> peer_checks();
[[nodiscard]] std::span<const Check> domain_checks();
[[nodiscard]] std::span<const Check> program_checks();

/// "sudo " where the user is not root.
[[nodiscard]] inline const char* as_root(const Facts& facts) { return facts.machine.root ? "" : "sudo "; }

/// The command that raises a limit of the shell; in a container that has not the right to, the one that starts another.
[[nodiscard]] std::string raise_limit(const Facts& facts, const std::string& limit, const std::string& value);

/// The own interface that the command line names; null: none is named or found.
[[nodiscard]] const Interface* own_interface(const Facts& facts);

}  // namespace subworld::doctor

#pragma once

#include "doctor/facts.hpp"
#include "io/results/output.hpp"

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
using Findings = std::vector<Finding>;

/// Judges facts. A check reports one cause once: a fault that follows from another one is not reported.
struct Check {
  const char* name;
  const char* about;  ///< what is in order, in words
  /// `findings` holds those of the checks before it.
  void (*judge)(const Facts& facts, Findings& findings);
};

/// All checks, in the order in which causes precede their effects.
[[nodiscard]] std::vector<Check> checks();
/// Their parts.
[[nodiscard]] std::span<const Check> machine_checks();
[[nodiscard]] std::span<const Check> network_checks();
[[nodiscard]] std::span<const Check> program_checks();

/// All findings. Each has the name of its check.
[[nodiscard]] Findings judge(const Facts& facts);

/// The command line of the doctor as given, for cures that change it.
[[nodiscard]] std::string command_of(const Request& request);

/// "sudo " where the user is not root.
[[nodiscard]] inline const char* as_root(const Facts& facts) { return facts.machine.root ? "" : "sudo "; }

/// The value of an environment variable; null: it is not set.
[[nodiscard]] const std::string* variable(const Facts& facts, std::string_view name);

}  // namespace subworld::doctor

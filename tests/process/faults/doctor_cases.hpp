#pragma once

#include "process/process_test.hpp"

#include <ostream>
#include <string>
#include <vector>

namespace subworld::test {

/// A misconfiguration: how it is brought about, and what the doctor has to say. All shell code runs in a mount, network
/// and process namespace of the case, in one shell. That shell has these functions and variables:
///   host_b           makes a second host, 10.77.0.2, at the other end of the interface eth0 (10.77.0.1)
///   on_b COMMAND     runs a command on it
///   start COMMAND    starts a program in the background, and waits until it is on its domain
///   $WORK            an empty folder;  $SOURCE, $BIN, $BROKEN   folders of the sources, the programs, broken engines
struct Misconfiguration {
  std::string name;
  std::string check;  ///< that names it
  std::string setup;
  std::string arguments;             ///< of `subworld doctor`
  std::string wrapper = {};          ///< command that starts the shell, to take rights from it
  std::string instead_of_cure = {};  ///< where the cure belongs to another host: what has its effect there
  std::string left = {};             ///< findings that remain
};

void PrintTo(const Misconfiguration& wrong, std::ostream* to);

/// Those that a test can bring about on one machine.
[[nodiscard]] const std::vector<Misconfiguration>& misconfigurations();

class Doctor : public ProcessTest {
 protected:
  /// Whether this machine lets a test have namespaces of its own.
  [[nodiscard]] bool has_namespaces() const;
  /// Brings a misconfiguration about; the doctor has to name it and nothing else, and its cure has to cure it.
  void expect_found_and_cured(const Misconfiguration& wrong) const;
  /// Runs shell code in namespaces of its own, as described above, and `after` when that shell has ended.
  [[nodiscard]] Ended run_apart(const std::string& code, const std::string& wrapper = {},
                                const std::string& after = {}) const;
};

}  // namespace subworld::test

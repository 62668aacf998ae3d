#pragma once

#include "judge/summary.hpp"
#include "session/session_file.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace subworld {

/// A host of a session that is reached by ssh.
class DistantHost {
 public:
  static constexpr int kSshFailed = 255;  ///< exit code of ssh: its own failure, or a signal ended the program

  /// `ssh`: the program; `results`: name of the run's folder of results.
  DistantHost(const SessionHost& host, std::string ssh, const std::string& results);

  /// Throws `Error` (failed) where ssh or the programs do not start there.
  void check(const std::string& session_file) const;
  /// Its wall clock minus this one: of ten exchanges the one with the shortest round trip, which is halved (NTP's
  /// formula). No figures where the host does not answer.
  [[nodiscard]] HostClock clock() const;
  /// Folder of its results there, below its checkout.
  [[nodiscard]] const std::string& folder() const { return folder_; }
  enum class Resume : std::uint8_t {
    no,
    where_it_can,  ///< a world goes on from its newest checkpoint there, if there is one
  };
  /// The arguments of ssh that run a program of the checkout there.
  [[nodiscard]] std::vector<std::string> words_of(const std::string& program, const std::vector<std::string>& words,
                                                  Resume resume = Resume::no) const;
  /// Brings its results here. Prints a warning with the command where that fails.
  void fetch(const std::string& folder_here) const;

 private:
  /// A command line that runs a command there.
  [[nodiscard]] std::string by_ssh(const std::string& command) const;

  const SessionHost& host_;
  std::string ssh_;
  std::string checkout_;
  std::string folder_;
};

}  // namespace subworld

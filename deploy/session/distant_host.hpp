#pragma once

#include "session/dialogue.hpp"
#include "session/host.hpp"

#include <memory>
#include <string>
#include <vector>

namespace subworld {

/// A host of a session that is reached by ssh.
class DistantHost : public Host {
 public:
  /// `ssh`: the program. The folder of the results there, below its checkout, has the name of the run's. Throws `Error`
  /// (failed) where ssh or the programs do not start there.
  DistantHost(const SessionHost& plan, const std::string& folder_here, std::string ssh,
              const std::string& session_file);

  [[nodiscard]] bool is_here() const noexcept override { return false; }
  [[nodiscard]] const std::string& folder() const noexcept override { return folder_; }
  [[nodiscard]] bool has_ended_world() const override;
  [[nodiscard]] Command command(const RunProgram& program, std::vector<std::string> flags, bool again) const override;
  /// Its wall clock minus this one: of ten exchanges the one with the shortest round trip, which is halved (NTP's
  /// formula). No figures where the host does not answer.
  [[nodiscard]] HostClock clock() const override;
  void start_recorder(std::vector<std::string> flags) override;
  void fetch() const override;

 private:
  /// A command line that runs a command there.
  [[nodiscard]] std::string by_ssh(const std::string& command) const;

  /// Shell commands before a program, with which it finds the recorder's memory.
  [[nodiscard]] std::string opened_messages(const RunProgram& program) const;

  std::string ssh_;
  std::string checkout_;
  std::string folder_;
  std::unique_ptr<Dialogue> recorder_;
  std::vector<std::string> places_;  ///< process of the recorder, and where the messages of each program are
};

}  // namespace subworld

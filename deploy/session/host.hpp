#pragma once

#include "judge/summary.hpp"
#include "link/network.hpp"
#include "run/supervise.hpp"
#include "session/session_file.hpp"

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace subworld {

/// File of the messages of a host of several, in its folder.
inline constexpr const char* kRecordingPart = "recording.mcap";

/// A host of a run, where programs start. This one is the launcher's machine, or a network namespace of it.
class Host {
 public:
  /// `folder`: for the results. `inside`: null where the programs are in the launcher's own namespace.
  Host(const SessionHost& plan, std::string folder, const NetworkHost* inside = nullptr)
      : plan_(plan), folder_here_(std::move(folder)), inside_(inside) {}
  virtual ~Host() = default;
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

  [[nodiscard]] const SessionHost& plan() const noexcept { return plan_; }
  [[nodiscard]] virtual bool is_here() const noexcept { return true; }
  /// Folder of the results on the launcher's machine, once they are fetched.
  [[nodiscard]] const std::string& folder_here() const noexcept { return folder_here_; }
  /// The same as the programs know it.
  [[nodiscard]] virtual const std::string& folder() const noexcept { return folder_here_; }
  /// How a program starts. `again`: a world goes on from its newest checkpoint, if it has written one.
  [[nodiscard]] virtual Command command(const RunProgram& program, std::vector<std::string> flags, bool again) const;
  /// Whether a world there has written its results, of which the launcher's machine does not know.
  [[nodiscard]] virtual bool has_ended_world() const { return false; }
  /// Its clock beside that of the launcher.
  [[nodiscard]] virtual HostClock clock() const { return {plan_.name, 0.0, 0.0}; }
  /// Before the programs start: records them there, if they do not inherit the memory of the launcher's recording.
  /// `flags`: those of the run that all programs share.
  virtual void start_recorder(std::vector<std::string> /*flags*/) {}
  /// Brings the results here. Prints a warning where that fails.
  virtual void fetch() const {}
  /// Calls `act` in the host's network namespace.
  void inside(const std::function<void()>& act) const { inside_ == nullptr ? act() : inside_->inside(act); }

 private:
  const SessionHost& plan_;
  std::string folder_here_;
  const NetworkHost* inside_;
};

class Dialogue;

/// A host of a session that is reached by ssh.
class DistantHost : public Host {
 public:
  /// `ssh`: the program. The folder of the results there, below `folder`, has the name of the run's. Throws `Error`
  /// (failed) where ssh or the programs do not start there.
  DistantHost(const SessionHost& plan, const std::string& folder_here, std::string ssh,
              const std::string& session_file);
  ~DistantHost() override;

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
  std::string work_;      ///< folder there from which programs start
  std::string programs_;  ///< folder there
  std::string folder_;
  std::unique_ptr<Dialogue> recorder_;
  std::vector<std::string> places_;  ///< process of the recorder, and where the messages of each program are
};

/// A network namespace for each host of a session, with links between them. Sets the hosts' addresses and interfaces,
/// and the `link` between any two, in words. Throws `Error` (failed) without the rights.
[[nodiscard]] std::unique_ptr<EmulatedNetwork> make_namespaces(Session& session, const RunRequest& request,
                                                               std::string& link);

}  // namespace subworld

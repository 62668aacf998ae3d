#pragma once

#include "model/messages/exchange.hpp"
#include "wire/bus.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace subworld::live {

struct ServerConfig {
  std::string address = "127.0.0.1";  ///< IPv4 or IPv6, own
  int port = 0;                       ///< 0: any free one
  std::string token;                  ///< that clients must give; empty: none
  std::vector<std::string> origins;   ///< of other sites whose pages may read, as https://example.org
  std::string name;                   ///< of the scene
  int users = 0;
  int domain = 0;  ///< of the run
};

/// Serves the topics of a run to viewers, by the Foxglove WebSocket protocol. Works in a thread of its own, to which
/// the caller's functions only pass data. Whatever a client does, and whatever fails in that thread, stays there.
class Server {
 public:
  /// Listens from now on. The bus must outlive the server. Throws `Error` (failed) where it cannot listen.
  Server(const ServerConfig& config, Bus& bus);
  /// Sends what waits for the clients, within half a second, and ends their connections.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// The world, when it is known.
  void describe(const SceneDescription& scene);
  /// Where a program of the run was found.
  void place(ProgramKind program, std::uint32_t instance, const PeerProgram& peer);
  /// The run is over: no tool moves from now on.
  void end_run();
  /// Whether a viewer subscribes to the verdict.
  [[nodiscard]] bool verdict_is_awaited() const;
  /// The verdict, of the summary of the run.
  void show_verdict(const std::string& summary_file);
  /// "127.0.0.1:8765"
  [[nodiscard]] const std::string& address() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace subworld::live

#pragma once

#include "io/results/results.hpp"
#include "wire/topics.hpp"

#include <string>
#include <vector>

/// The matrix of the lab: which networks, services and loads are measured.
namespace subworld {

enum class NetworkTransport : std::uint8_t {
  udp,       ///< each program on a host of its own, over the emulated link
  loopback,  ///< all programs on this host, without a link
};

/// One setting that is measured.
struct NetworkCell {
  std::string world_dds = "fastdds";
  std::string haptic_dds = "fastdds";
  NetworkTransport transport = NetworkTransport::udp;
  bool reliable = false;
  double rate_hz = 1000.0;  ///< of the messages from the world to each user
  int payload_bytes = 256;  ///< of a message
  int users = 1;
  int depth = 8;               ///< of the history: keep last
  std::string link = "ideal";  ///< as `parse_link` reads it; "ideal" on loopback
};

inline constexpr int kMostNetworkUsers = 16;
inline constexpr int kLeastPayload_bytes = 32, kMostPayload_bytes = 1'000'000;

/// The values of each axis; every combination is a cell.
struct NetworkAxes {
  std::vector<std::string> world_dds{"fastdds", "cyclonedds"};
  std::vector<std::string> haptic_dds{"fastdds", "cyclonedds"};
  std::vector<std::string> transports{"udp"};
  std::vector<std::string> reliabilities{"best_effort", "reliable"};
  std::vector<double> rates_hz{1000.0};
  std::vector<int> payloads_bytes{256};
  std::vector<int> users{1};
  std::vector<int> depths{8};
  std::vector<std::string> links{"ideal", "wifi"};
};

/// The cells in the order in which they run: the vendor pairs of a setting directly after each other. Loopback has no
/// link, so its cells are not repeated for each link. Throws `Error` (usage) for a link that cannot be read.
[[nodiscard]] std::vector<NetworkCell> cells_of(const NetworkAxes& axes);

/// The quality of service that both sides request: as the product does for messages at this rate.
[[nodiscard]] Qos qos_of(const NetworkCell& cell);
[[nodiscard]] std::string to_text(const Qos& qos);

[[nodiscard]] const char* name_of(NetworkTransport transport) noexcept;
[[nodiscard]] const char* reliability_of(const NetworkCell& cell) noexcept;
/// For people: "fastdds > cyclonedds  udp  reliable  1000 Hz  256 bytes  1 user  wifi".
[[nodiscard]] std::string to_text(const NetworkCell& cell);
/// The same without the vendors.
[[nodiscard]] std::string setting_of(const NetworkCell& cell);
/// The columns of a row that name the cell.
[[nodiscard]] Json columns_of(const NetworkCell& cell);
/// The options of the lab that choose this cell alone.
[[nodiscard]] std::string options_of(const NetworkCell& cell);

}  // namespace subworld

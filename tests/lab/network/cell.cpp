#include "lab/network/cell.hpp"

#include "io/results/json.hpp"
#include "link/settings.hpp"

#include <fmt/core.h>

namespace subworld {

namespace {

constexpr const char* kReliabilityNames[] = {"best_effort", "reliable"};
constexpr const char* kTransportNames[] = {"udp", "loopback"};

/// `cells`, each with each value of an axis.
template <class Value, class Set>
void multiply(std::vector<NetworkCell>& cells, const std::vector<Value>& values, Set set) {
  std::vector<NetworkCell> product;
  for (const NetworkCell& cell : cells) {
    for (const Value& value : values) {
      NetworkCell& one = product.emplace_back(cell);
      set(one, value);
    }
  }
  cells = std::move(product);
}

}  // namespace

std::vector<NetworkCell> cells_of(const NetworkAxes& axes) {
  for (const std::string& link : axes.links) (void)parse_link(link);
  std::vector<NetworkCell> cells(1);
  multiply(cells, axes.transports, [](NetworkCell& cell, const std::string& name) {
    cell.transport = name == kTransportNames[0] ? NetworkTransport::udp : NetworkTransport::loopback;
  });
  multiply(cells, axes.links, [](NetworkCell& cell, const std::string& link) { cell.link = link; });
  std::erase_if(cells, [&](const NetworkCell& cell) {
    return cell.transport == NetworkTransport::loopback && cell.link != axes.links.front();
  });
  for (NetworkCell& cell : cells) {
    if (cell.transport == NetworkTransport::loopback) cell.link = "ideal";
  }
  multiply(cells, axes.reliabilities,
           [](NetworkCell& cell, const std::string& name) { cell.reliable = name == kReliabilityNames[1]; });
  multiply(cells, axes.users, [](NetworkCell& cell, int users) { cell.users = users; });
  multiply(cells, axes.depths, [](NetworkCell& cell, int depth) { cell.depth = depth; });
  multiply(cells, axes.payloads_bytes, [](NetworkCell& cell, int bytes) { cell.payload_bytes = bytes; });
  multiply(cells, axes.rates_hz, [](NetworkCell& cell, double rate_hz) { cell.rate_hz = rate_hz; });
  multiply(cells, axes.world_dds, [](NetworkCell& cell, const std::string& name) { cell.world_dds = name; });
  multiply(cells, axes.haptic_dds, [](NetworkCell& cell, const std::string& name) { cell.haptic_dds = name; });
  return cells;
}

Qos qos_of(const NetworkCell& cell) {
  Qos qos;
  qos.reliable = cell.reliable;
  qos.depth = cell.depth;
  qos.deadline_s = deadline_s(2.0 / cell.rate_hz);
  return qos;
}

std::string to_text(const Qos& qos) {
  return fmt::format("{} {} keep_last {} deadline {:.4g} s lease {:g} s blocking {:g} s",
                     kReliabilityNames[qos.reliable ? 1 : 0], qos.transient_local ? "transient_local" : "volatile",
                     qos.depth, qos.deadline_s, qos.lease_s, qos.max_blocking_s);
}

const char* name_of(NetworkTransport transport) noexcept { return kTransportNames[static_cast<int>(transport)]; }

const char* reliability_of(const NetworkCell& cell) noexcept { return kReliabilityNames[cell.reliable ? 1 : 0]; }

std::string setting_of(const NetworkCell& cell) {
  return fmt::format("{} {:g} Hz {} bytes {} user{} depth {} {}", reliability_of(cell), cell.rate_hz,
                     cell.payload_bytes, cell.users, cell.users == 1 ? "" : "s", cell.depth,
                     cell.transport == NetworkTransport::udp ? cell.link : name_of(cell.transport));
}

std::string to_text(const NetworkCell& cell) {
  return fmt::format("{:>10} > {:<10} {}", cell.world_dds, cell.haptic_dds, setting_of(cell));
}

Json columns_of(const NetworkCell& cell) {
  const LinkSettings link = parse_link(cell.link);
  return {{"world_dds", cell.world_dds},
          {"haptic_dds", cell.haptic_dds},
          {"transport", name_of(cell.transport)},
          {"reliability", reliability_of(cell)},
          {"rate_hz", cell.rate_hz},
          {"payload_bytes", cell.payload_bytes},
          {"users", cell.users},
          {"depth", cell.depth},
          {"link", cell.link},
          {"delay_s", link.delay_s},
          {"jitter_s", link.jitter_s},
          {"loss_ratio", link.loss.loss_ratio()}};
}

std::string options_of(const NetworkCell& cell) {
  return fmt::format(
      "--world-dds {} --haptic-dds {} --transport {} --reliability {} --rate {} --payload {} --users {} --depth {} "
      "--link '{}'",
      cell.world_dds, cell.haptic_dds, name_of(cell.transport), reliability_of(cell), cell.rate_hz, cell.payload_bytes,
      cell.users, cell.depth, cell.link);
}

}  // namespace subworld

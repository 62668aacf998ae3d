#pragma once

#include "model/messages/exchange.hpp"
#include "wire/codec/codec.hpp"

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace subworld::live {

/// The schema of `subworld::msg::WorldView`: a `WorldState` without `moved`, then `placed` with 32 bytes for each body
/// that moved, in place of 112.
[[nodiscard]] std::string world_view_schema();

/// A row of `placed`, without padding. `qw` is positive and follows from the others.
struct Placed {
  std::uint32_t body;
  float x, y, z, qx, qy, qz, speed;
};
static_assert(sizeof(Placed) == 32);

/// Collects snapshots of the world and makes views of it, fewer of them where many bodies move.
class WorldViewer {
 public:
  /// Takes a sample of `WorldState`. Ignores one that is not valid, and bodies that the scene does not have.
  void take(std::span<const std::uint8_t> cdr, std::size_t bodies);
  /// The view, as CDR with its header, if there is news and the last one was small enough for its age.
  [[nodiscard]] std::optional<std::vector<std::uint8_t>> make(std::uint64_t now_ns);

 private:
  Codec<WorldSnapshot> codec_;
  WorldSnapshot snapshot_;
  std::map<BodyId, Placed> moved_;  // since the last view
  bool changed_ = false;
  std::uint64_t next_ns_ = 0;
};

}  // namespace subworld::live

#pragma once

#include "coupling/tool/virtual_coupling.hpp"
#include "model/messages/exchange.hpp"
#include "physics/engine.hpp"

#include <cstdint>
#include <optional>
#include <span>

namespace subworld {

/// The device of another user, whose spring pulls a proxy that is not in the engine.
struct PeerPull {
  BodyId proxy{};
  DevicePose device;
  CouplingSettings coupling;
  double limit_n = 0.0;
};

/// A scheme's side in a haptic process: what represents the outside at the border of a sub-world, in its engine.
class SubWorldSide {
 public:
  virtual ~SubWorldSide() = default;

  /// How the border follows a frame.
  struct Following {
    double lag_s = 0.0;  ///< age of the frame
    double gain = 0.0;   ///< the part of an error that is corrected, 0 .. 1,
    int substeps = 1;    ///< spread over so many steps
  };
  /// Takes over a frame, after the members have entered, left and been corrected.
  virtual void follow(const WorldFrame& frame, Engine& engine, const Following& how) = 0;
  /// Removes a body that becomes a member from the engine. Its state, if the border simulated it.
  [[nodiscard]] virtual std::optional<BodyState> release(BodyId id, Engine& engine) = 0;
  /// Removes everything from the engine.
  virtual void clear(Engine& engine) = 0;

  /// Before each step of `dt` s. `operators_n`: sum of the forces of all operators on bodies in the engine, N.
  virtual void begin(Engine& engine, double dt, double operators_n, std::span<const PeerPull> peers) = 0;
  /// After each step.
  virtual void end(const Engine& /*engine*/, double /*dt*/) {}
  /// Stores the states of the border's bodies at a stamp.
  virtual void log(std::uint64_t /*stamp*/, const Engine& /*engine*/) {}
};

}  // namespace subworld

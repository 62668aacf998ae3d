#pragma once

#include "coupling/border.hpp"
#include "coupling/scheme.hpp"
#include "model/exchange.hpp"
#include "model/scene.hpp"
#include "physics/engine.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace subworld {

/// What stands for the outside at the border of a sub-world, in its engine.
class BorderModel {
 public:
  virtual ~BorderModel() = default;

  /// How the border follows a frame.
  struct Following {
    double lag_s = 0.0;  ///< age of the frame
    double gain = 0.0;   ///< the part of an error that is corrected,
    int parts = 1;       ///< in so many steps
  };
  /// `left` are members that are none any more, ascending, as they were. Members have come, gone and been corrected
  /// before.
  virtual void follow(const WorldFrame& frame, std::span<const StampedBody> left, Engine& engine,
                      const Following& how) = 0;
  /// Takes a body that becomes a member out of the engine; what it was doing, if the border held it.
  [[nodiscard]] virtual std::optional<BodyState> release(BodyId id, Engine& engine) = 0;
  virtual void clear(Engine& engine) = 0;

  /// Before and after each step of `dt`. `operators_n`: how hard all hands together press on what is in the engine.
  virtual void begin(Engine& engine, double dt, double operators_n) = 0;
  virtual void end(const Engine& engine, double dt) = 0;
  /// Writes down where the border's bodies are at a stamp.
  virtual void log(std::uint64_t stamp, const Engine& engine) = 0;
};

/// The scheme's. It has a sub-world.
[[nodiscard]] std::unique_ptr<BorderModel> make_border_model(const Scheme& scheme, const Scene& scene,
                                                             std::uint64_t remembered_cycles);

}  // namespace subworld

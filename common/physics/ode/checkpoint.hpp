#pragma once

#include "friction.hpp"
#include "physics/engine.hpp"

#include <array>
#include <cstdint>
#include <vector>

namespace subworld::ode {

/// A body in a checkpoint.
struct SavedBody {
  std::uint64_t id;
  std::array<double, 13> state;
  std::array<double, 10> load;  ///< mass, inertia, force and torque of the next step
};

/// The whole state on which ODE's next step depends.
struct Saved {
  std::vector<SavedBody> bodies;  ///< movable ones in the order of adding, which is ODE's order of solving
  std::vector<Friction> frictions;
};

[[nodiscard]] Checkpoint pack(const Saved& saved);
/// Throws `Error` if the checkpoint is not one of ODE's.
[[nodiscard]] Saved unpack(const Checkpoint& checkpoint);

/// Throws the error for a checkpoint that does not fit.
[[noreturn]] void refuse_checkpoint();

}  // namespace subworld::ode

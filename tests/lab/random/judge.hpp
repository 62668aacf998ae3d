#pragma once

#include "io/results/results.hpp"
#include "model/scene/scene.hpp"
#include "physics/engine.hpp"

#include <cstdint>
#include <string>

namespace subworld {

/// Fault of a run, the most severe first.
enum class Fault : std::uint8_t { none, crash, exception, not_finite, hash, force, energy, port };
inline constexpr const char* kFaultNames[] = {"none", "crash", "exception", "not finite",
                                              "hash", "force", "energy",    "operator energy"};

/// Largest gain of energy, relative to the energy put in.
inline constexpr double kMostGain = 0.01;
/// Tolerances in addition: the weight of all bodies times the depth at which engines let bodies rest, and the deepest
/// penetration at the start, from which a body may rise. Also the reading error of the energy balance.
inline constexpr double kRestDepth_m = 1e-5;
inline constexpr double kLeastGain_j = 1e-6;
/// Largest energy created at the operator's port with passivity on: absolute, and relative to its work.
inline constexpr double kMostAtOperator_j = 1e-3, kMostAtOperator = 0.01;

struct Verdict {
  Fault fault = Fault::none;
  std::string reason;  ///< with numbers and units; empty without a fault
  double at_s = 0.0;   ///< time of the fault
  double gain = 0.0;   ///< largest unexplained energy above the tolerance, relative to the energy put in until then
  double unexplained_j = 0.0;  ///< at that time, like the next ones; without a fault at the end
  double put_in_j = 0.0;
  double users_j = 0.0;        ///< net work of the users
  double corrected_j = 0.0;    ///< net
  double released_j = 0.0;     ///< by gravity
  double at_operator_j = 0.0;  ///< largest energy that an operator received beyond what the coupling could store
  double force_n = 0.0;        ///< largest force on an operator
  double seconds = 0.0;        ///< CPU time
  std::string hash;
};
[[nodiscard]] Json to_json(const Verdict& verdict);
[[nodiscard]] Verdict verdict_of(const Json& json);

/// Runs a scene twice in lock-step and judges it. Never throws. For crashes see lab/apart.
[[nodiscard]] Verdict judged(const Scene& scene, const EngineMaker& make = make_engine);

}  // namespace subworld

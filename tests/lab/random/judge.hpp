#pragma once

#include "io/results.hpp"
#include "model/scene.hpp"
#include "physics/engine.hpp"

#include <cstdint>
#include <string>

namespace subworld {

/// What is wrong with a run, the worst first.
enum class Fault : std::uint8_t { none, crash, exception, not_finite, hash, force, energy, port };
inline constexpr const char* kFaultNames[] = {"none", "crash", "exception", "not finite",
                                              "hash", "force", "energy",    "hand energy"};

/// Energy that a run may gain beyond what was put in, as a part of that.
inline constexpr double kMostGain = 0.01;
/// And beside that: the weight of all bodies times the depth in which engines let bodies rest, and the deepest
/// penetration at the begin: a body that sank before comes up again. And what the book cannot read exactly.
inline constexpr double kRestDepth_m = 1e-5;
inline constexpr double kLeastGain_j = 1e-6;
/// Energy at the hand's port that may come from nowhere where passivity is on, and as a part of its work.
inline constexpr double kMostAtOperator_j = 1e-3, kMostAtOperator = 0.01;

struct Verdict {
  Fault fault = Fault::none;
  std::string reason;          ///< with numbers and units; empty where nothing is wrong
  double at_s = 0.0;           ///< when it was seen
  double gain = 0.0;           ///< largest unexplained energy above the floor, over what was put in until then
  double unexplained_j = 0.0;  ///< then, as the next ones; at the end where there was none
  double put_in_j = 0.0;
  double users_j = 0.0;        ///< net work of the users
  double corrected_j = 0.0;    ///< net
  double released_j = 0.0;     ///< by gravity
  double at_operator_j = 0.0;  ///< most that a hand got from nowhere
  double force_n = 0.0;        ///< most on a hand
  double seconds = 0.0;        ///< CPU time
  std::string hash;
};
[[nodiscard]] Json to_json(const Verdict& verdict);
[[nodiscard]] Verdict verdict_of(const Json& json);

/// Runs a scene twice in lock-step and judges it. Never throws; a crash is for who runs it (lab/apart).
[[nodiscard]] Verdict judged(const Scene& scene, const EngineMaker& make = make_engine);

}  // namespace subworld

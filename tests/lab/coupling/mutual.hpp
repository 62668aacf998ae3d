#pragma once

#include "lab/coupling/measure.hpp"

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// How late a user feels the motion of another one.
///
/// | symbol | unit | is |
/// |---|---|---|
/// | A, B | | two users |
/// | t_A | s | of five instants at which A and another user press, the one with the largest answers in the reference |
/// | F_B, F_B' | N | felt force of B, without and with the nudge |
///
/// At t_A the device of A is nudged: displaced by kNudge_m along its force, within kNudge_s. Both runs repeat bit by
/// bit, so the answer of B is the effect of the nudge alone, also in a scene that is chaotic:
///   r(t) = |F_B'(t) - F_B(t)|,  t >= t_A                                                                     (1)
///   t_AB: the first time with r >= max r / 2, with max r of the reference                                     (2)
///   mutual latency of B = max over A of t_AB - t_AB of the reference                                          (3)
/// B does not feel A where max r is below kLeastShare of the force that the nudge causes at A, K_A kNudge_m.
struct MutualLatency {
  double late_s = 0.0;       ///< (3), at most kLongest_s: by then the answer is still below half of the reference's
  std::size_t of_user = 0;   ///< A
  double reference_s = 0.0;  ///< t_AB - t_A of the reference
};

inline constexpr double kNudge_m = 1e-3, kNudge_s = 0.01, kLeastShare = 0.05, kLongest_s = 0.5;

/// Measures mutual latencies, and knows the answers of each reference.
class MutualLatencies {
 public:
  /// Fills `late`, by user B; none where B feels no other user. `run` is of scene_of(point). False if a signal
  /// requested a stop.
  bool measure(const Point& point, const Outcome& run, const Reference& reference,
               std::vector<std::optional<MutualLatency>>& late);

 private:
  struct Answer {
    std::size_t by;
    double level_n;  ///< max r / 2
    double after_s;  ///< t_AB - t_A
  };
  struct Nudge {
    std::size_t user;
    double at_s = 0.0;
    Vec3 displacement = Vec3::Zero();
    std::vector<Answer> answers = {};
  };
  [[nodiscard]] const std::vector<Nudge>* nudges_of(const Point& point, const Reference& reference);

  std::map<std::string, std::vector<Nudge>> known_;  ///< by reference
};

}  // namespace subworld

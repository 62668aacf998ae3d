#pragma once

#include "io/results/results.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

/// When a user notices a delay: what is measured at one delay, its bounds, and the largest delay within them.
namespace subworld {

/// A run is within the bounds if every criterion is at most its bound.
enum class Criterion : std::uint8_t {
  unstable,  ///< 1 where a state became infinite or not a number
  rms,       ///< RMS error of the force on the operator, relative (lab/session/metrics)
  p99,       ///< its 99th percentile, relative to the largest force
  offset,    ///< |time offset| of that force, s
  energy,  ///< energy that the operator received though neither the coupling, nor another operator, nor a body had it,
           ///< J
  oscillation,  ///< oscillation of the force (coupling/safety/oscillation), more than in the reference, N
  stiffness,    ///< stiffness of the coupling over the largest stable one (coupling/tool/stiffness)
};
inline constexpr std::size_t kCriteria = 7;

/// The values of all criteria, or their bounds.
class Criteria {
 public:
  double& operator[](Criterion criterion) noexcept { return values_[static_cast<std::size_t>(criterion)]; }
  double operator[](Criterion criterion) const noexcept { return values_[static_cast<std::size_t>(criterion)]; }

 private:
  std::array<double, kCriteria> values_{};
};

struct CriterionText {
  Criterion criterion;
  const char* column;   ///< in a table
  const char* subject;  ///< in a sentence
  double scale;         ///< from the column's unit to that of the sentence
  const char* unit;
};
inline constexpr std::array<CriterionText, kCriteria> kCriterionTexts{{
    {Criterion::unstable, "unstable", "the simulation is unstable", 1.0, ""},
    {Criterion::rms, "force_error_rms", "the RMS error is", 1e2, " %"},
    {Criterion::p99, "force_error_p99", "the 99th percentile of the error is", 1e2, " %"},
    {Criterion::offset, "time_offset_s", "the time offset is", 1e3, " ms"},
    {Criterion::energy, "created_j", "the energy created at the operator is", 1e3, " mJ"},
    {Criterion::oscillation, "oscillation_n", "the oscillation of the force is", 1.0, " N"},
    {Criterion::stiffness, "stiffness_ratio", "the stiffness of the coupling is", 1.0, " times the largest stable one"},
}};

/// Half the force JND, the force JND, a third of the delay that users detected; the energy that lifts 10 g by 1 cm;
/// the friction of a desktop device; the edge of stability.
[[nodiscard]] Criteria default_bounds() noexcept;

/// The criterion that exceeds its bound most, relative to the bound. A value that is not a number exceeds it.
[[nodiscard]] std::optional<Criterion> exceeded(const Criteria& values, const Criteria& bounds) noexcept;

/// The largest value over its bound, of the criteria that have one.
[[nodiscard]] double nearness(const Criteria& values, const Criteria& bounds) noexcept;

/// "the RMS error is 3.6 %"
[[nodiscard]] std::string text_of(Criterion criterion, double value);

/// What a user felt at one delay.
struct Sample {
  double delay_s = 0.0;
  Criteria values;
  bool disturbed = false;  ///< the OS or the run were late: beyond the bounds, it says nothing
};

/// The largest measured delay at which, and at all smaller measured ones, a user is within the bounds.
struct Limit {
  std::optional<double> within_s;  ///< none: not even the smallest delay is within
  std::optional<Sample> beyond;    ///< the next larger measured delay; none: every delay is within
  std::optional<Criterion> limited_by;
};
/// `samples`: by rising delay.
[[nodiscard]] Limit limit_of(std::span<const Sample> samples, const Criteria& bounds);

/// The answer for one user.
struct UserLimit {
  std::string name;
  Limit limit;
  std::string undecided;  ///< why no limit can be given; empty: there is one
};

/// What the sentence says beyond the users' limits.
struct Question {
  std::string scene;
  std::string link;      ///< "round-trip delay"
  bool finished = true;  ///< false: the search was stopped, by a signal or by a disturbed machine
  std::string disturbed = {};
};
/// One sentence: the least limit of all users, and what exceeds its bound beyond it.
[[nodiscard]] std::string sentence_of(const Question& question, std::span<const UserLimit> users);

}  // namespace subworld

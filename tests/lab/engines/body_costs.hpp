#pragma once

#include "lab/page/tables.hpp"

#include <functional>
#include <string>
#include <vector>

/// Cost of a body in a haptic step: step time against the number of bodies (paper, figure 12).
namespace subworld {

inline constexpr const char* kSpaced = "spaced";  ///< cubes in the air, three widths apart
inline constexpr const char* kDense = "dense";    ///< cubes poured into a bin as wide as the heap is high, settled
inline constexpr double kCostStep_s = 1e-3;
inline constexpr double kPaperSpaced_ms = 0.0016;  ///< per body
inline constexpr double kPaperDense_ms = 0.011;
/// Haptic periods for which the largest sub-world is determined.
inline constexpr double kPeriods_s[] = {1e-3, 0.5e-3, 0.25e-3};

/// One row for each arrangement and number of bodies. `progress` is called with each row. After a signal, returns the
/// rows measured until then. An engine that fails gives no row.
[[nodiscard]] Rows body_costs(const std::string& engine, const std::string& preset,
                              const std::function<void(const Json&)>& progress);

/// The rows of one engine, preset and arrangement, bodies ascending.
struct CostCurve {
  std::string engine;
  std::string preset;
  std::string arrangement;
  Rows rows;
};
[[nodiscard]] std::vector<CostCurve> curves_of(const Rows& costs);

/// Fit of a step's mean CPU time (s) against the number of bodies or contacts.
[[nodiscard]] LineFit per_body(const CostCurve& curve);
[[nodiscard]] LineFit per_contact(const CostCurve& curve);

/// The largest world within a period, interpolated between the measured ones.
struct Fitting {
  double bodies = 0.0;
  bool below = false;  ///< the smallest measured world, `bodies`, is too large
  bool above = false;  ///< the largest measured world, `bodies`, still fits
  [[nodiscard]] std::string text() const;
};
/// `quantile`: "mean" or "p99" of the step's wall time.
[[nodiscard]] Fitting largest(const CostCurve& curve, double period_s, const std::string& quantile);

}  // namespace subworld

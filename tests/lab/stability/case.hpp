#pragma once

#include "lab/session/setting.hpp"
#include "lab/stability/search.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// How the error of a measurement is counted.
enum class Compare : std::uint8_t {
  relative,  ///< |measured - expected| / |expected|
  absolute,  ///< |measured - expected|, in the quantity's unit
  at_least,  ///< a limit that shall be no lower: expected / measured, so 1 is the bound
  at_most,   ///< a limit that shall be no higher: measured / expected
};

struct Measurement {
  double measured = 0.0;
  std::optional<Bracket> bracket = {};  ///< where a limit was searched
};
/// A limit for which a formula gives a number.
[[nodiscard]] inline Measurement limit_at(const Bracket& bracket) { return {bracket.middle(), bracket}; }
/// A limit that shall be reached: what was seen to hold counts.
[[nodiscard]] inline Measurement limit_proven(const Bracket& bracket) { return {bracket.proven(), bracket}; }

/// One case of the stability lab: a row of a table. Adding a row adds the case to the lab, its page and its help.
struct StabilityCase {
  std::string name;
  std::string group = {};      ///< of the table that it stands in
  std::string shows;           ///< in a sentence
  std::string parameter = {};  ///< that is varied; empty: none but the searched limit itself
  std::string parameter_unit = {};
  std::vector<double> values = {};  ///< of the parameter; a measurement for each
  std::size_t quick_values = 1;     ///< so many of the first ones are measured with --quick
  std::string quantity;             ///< that is measured
  std::string unit;
  std::string formula;
  std::string source;  ///< of the formula, or of the reference
  Compare compare = Compare::relative;
  double tolerance = 0.02;  ///< of the error
  std::string why;          ///< the tolerance is what it is
  std::function<double(double value)> expected = [](double) { return 0.0; };
  std::function<Measurement(const Setting& setting, double value)> measure;
  bool own_step = false;  ///< it chooses its steps itself, so one step of the setting is enough
  bool once = false;      ///< engines have no part in it: measured for none of them
};

}  // namespace subworld

#pragma once

#include "lab/engines/judge.hpp"
#include "lab/page/tables.hpp"

#include <string>
#include <vector>

namespace subworld {

/// The rule of `grade` in words.
extern const char* const kGradesInWords;

/// The rows of one engine and preset in one scene.
struct Variant {
  std::string engine;
  std::string preset;
  std::vector<const Json*> rows;

  [[nodiscard]] std::string name() const { return engine + " " + preset; }
};
/// In the order of the rows' engines.
[[nodiscard]] std::vector<Variant> variants_of(const Rows& rows);

/// "++", "+", "0" or "-" for a structure (paper, Table 2), from the rows with friction; "" if there are none.
[[nodiscard]] std::string grade(const Variant& variant);
/// The latest time at which the structure fell, 0 if a run failed, infinite if one held. Not a number without rows.
[[nodiscard]] double longest_stand_s(const std::vector<const Json*>& rows);
[[nodiscard]] std::vector<const Json*> with_friction(const Variant& variant);
[[nodiscard]] std::vector<const Json*> without_friction(const Variant& variant);

/// The paper's result for a scene and an engine of its time.
struct PaperGrade {
  const char* scene;
  const char* engine;  ///< in the paper
  const char* grade;
  const char* prose;
};
[[nodiscard]] std::vector<PaperGrade> paper_grades();

/// Advice on the engine for stiff structures, for large worlds and for haptic sub-worlds: one line for each that the
/// measurements permit, with the deciding number. `costs` are rows of body_costs.
[[nodiscard]] std::vector<std::string> advice(const Rows& rows, const Rows& costs);

}  // namespace subworld

#include "io/records/history_reader.hpp"
#include "io/results/json.hpp"
#include "lab/engines/report.hpp"
#include "lab/engines/run.hpp"

#include <array>

namespace subworld {

EngineFindings saved_engine_runs(const std::string& folder) {
  constexpr std::array kDrawn{"t_s", "kinetic_energy_j"};
  EngineFindings found{.rows = read_rows(folder + "/results.json"),
                       .courses = {},
                       .costs = read_rows(folder + "/bodies.json"),
                       .summary = read_json(folder + "/summary.json")};
  for (const Rows& scene : by_scene(found.rows)) {
    for (const Json& row : scene) {
      if (!alike(row, scene.front(), {"friction", "restitution", "dt_s"})) continue;
      Course& course = found.courses.emplace_back(Course{.row = row, .history = {}});
      HistoryReader rows(folder + "/histories/" + file_name_of(row) + ".csv");
      while (rows.next()) {
        Json& at = course.history.emplace_back();
        for (const char* column : kDrawn) at[column] = rows.at(column);
      }
    }
  }
  return found;
}

}  // namespace subworld

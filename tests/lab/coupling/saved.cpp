#include "lab/coupling/saved.hpp"

#include "io/records/history_reader.hpp"
#include "io/results/json.hpp"

#include <fmt/core.h>

#include <filesystem>
#include <limits>

namespace subworld {

namespace {

/// A value that is not a number is `null` in a file.
void restore_numbers(Json& row) {
  for (Json& value : row) {
    if (value.is_null()) value = std::numeric_limits<double>::quiet_NaN();
    if (value.is_object()) restore_numbers(value);
  }
}

Trace saved_trace(const std::string& folder, const Json& json) {
  const std::string file = json.at("file");
  Trace trace{.scene = json.at("scene"),
              .user = json.at("user"),
              .scheme = json.at("scheme"),
              .ratio = json.at("ratio"),
              .latency_s = json.at("latency_s"),
              .name = std::filesystem::path(file).stem(),
              .h_s = json.at("h_s"),
              .force = {},
              .reference = {},
              .ratios = {}};
  HistoryReader rows(folder + "/" + file);
  const auto vector = [&](const std::string& name) {
    return Vec3(rows.at(name + "_x_n"), rows.at(name + "_y_n"), rows.at(name + "_z_n"));
  };
  while (rows.next()) {
    trace.force.push_back(vector("force"));
    trace.reference.push_back(vector("reference"));
    trace.ratios.push_back(static_cast<int>(rows.at("ratio")));
  }
  return trace;
}

}  // namespace

void write_trace(const std::string& folder, const Trace& trace) {
  Rows rows;
  for (std::size_t i = 0; i < trace.force.size(); ++i) {
    const Vec3& f = trace.force[i];
    const Vec3& r = trace.reference[i];
    rows.push_back({{"time_s", static_cast<double>(i) * trace.h_s},
                    {"force_x_n", f.x()},
                    {"force_y_n", f.y()},
                    {"force_z_n", f.z()},
                    {"reference_x_n", r.x()},
                    {"reference_y_n", r.y()},
                    {"reference_z_n", r.z()},
                    {"ratio", trace.ratios[i]}});
  }
  write_csv(fmt::format("{}/traces/{}.csv", folder, trace.name), rows);
}

Json traces_json(const std::vector<Trace>& traces) {
  Json json = Json::array();
  for (const Trace& trace : traces) {
    json.push_back({{"file", "traces/" + trace.name + ".csv"},
                    {"scene", trace.scene},
                    {"user", trace.user},
                    {"scheme", trace.scheme},
                    {"ratio", trace.ratio},
                    {"latency_s", trace.latency_s},
                    {"h_s", trace.h_s}});
  }
  return json;
}

Findings saved_sweep(const std::string& folder) {
  Findings found{.rows = read_rows(folder + "/results.json"),
                 .users = read_rows(folder + "/users.json"),
                 .traces = {},
                 .summary = read_json(folder + "/summary.json")};
  for (Rows* table : {&found.rows, &found.users}) {
    for (Json& row : *table) restore_numbers(row);
  }
  for (const Json& trace : found.summary.at("traces")) {
    Trace saved = saved_trace(folder, trace);
    if (!saved.force.empty()) found.traces.push_back(std::move(saved));
  }
  return found;
}

}  // namespace subworld

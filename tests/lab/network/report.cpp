#include "lab/network/report.hpp"

#include "io/results/json.hpp"
#include "lab/network/ddsperf.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kMostLost = 0.01;

Json over(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? Json() : Json(static_cast<double>(part) / static_cast<double>(whole));
}

bool is_carried(const Json& row, const std::vector<Requirement>& requirements) {
  if (failed(row)) return false;
  if (!requirements.empty()) return missed_by(row, requirements).empty();
  const double link_ratio = row.at("reliability") == "reliable" ? 0.0 : row.at("loss_ratio").get<double>();
  return value_of(row, "lost_ratio") <= link_ratio + kMostLost && value_of(row, "refused") == 0.0;
}

std::uint64_t lost(const CellFindings& found, const Arrivals& at) {
  return found.sent - std::min(at.received, found.sent);
}

double bytes_per_s(const Json& row) { return value_of(row, "rate_hz") * value_of(row, "payload_bytes"); }

double worst(const Rows& rows, const std::string& column) {
  double most = std::nan("");
  for (const Json& row : rows) most = std::fmax(most, value_of(row, column));
  return most;
}

std::string ms_text(double s) { return std::isfinite(s) ? fmt::format("{:.3g} ms", 1e3 * s) : "too few samples"; }

/// Rows that are equal in these columns, in order.
std::vector<Rows> grouped(const Rows& rows, const std::vector<std::string>& columns) {
  std::vector<Rows> groups;
  for (const Json& row : rows) {
    const auto same = std::ranges::find_if(groups, [&](const Rows& g) { return alike(g.front(), row, columns); });
    (same == groups.end() ? groups.emplace_back() : *same).push_back(row);
  }
  return groups;
}

const std::vector<std::string> kLoadColumns{"rate_hz", "payload_bytes", "users", "depth"};

std::string sentence_of(const Rows& network, const std::vector<Requirement>& requirements) {
  const Json& any = network.front();
  const std::string name =
      fmt::format("{}, {}: ", any.at("transport") == "udp" ? "link " + any.at("link").get<std::string>() : "loopback",
                  any.at("reliability").get<std::string>());
  const Rows* best = nullptr;
  std::vector<Rows> loads = grouped(network, kLoadColumns);
  for (const Rows& load : loads) {
    if (!std::ranges::all_of(load, [&](const Json& row) { return is_carried(row, requirements); })) continue;
    const auto total = [](const Rows& rows) { return bytes_per_s(rows.front()) * value_of(rows.front(), "users"); };
    if (best == nullptr || total(load) > total(*best)) best = &load;
  }
  if (best == nullptr) {
    Rows measured = network;
    std::erase_if(measured, failed);
    if (measured.empty()) return name + "no cell could be measured: " + any.at("failure").get<std::string>();
    const auto least =
        std::ranges::min_element(measured, {}, [](const Json& row) { return value_of(row, "lost_ratio"); });
    return name +
           fmt::format(
               "carries no measured load with every vendor pair; the least loss is {:.2f} %, at {:g} Hz x {} bytes",
               1e2 * value_of(*least, "lost_ratio"), value_of(*least, "rate_hz"),
               least->at("payload_bytes").get<int>());
  }
  const Json& row = best->front();
  const int users = row.at("users");
  return name +
         fmt::format(
             "carries {:g} Hz x {} bytes for {} user{} with {} vendor pair{}: at most {:.2f} % lost, round trip p50 "
             "{}, p99 {}, longest gap {}",
             row.at("rate_hz").get<double>(), row.at("payload_bytes").get<int>(), users, users == 1 ? "" : "s",
             best->size() == 1 ? "the" : fmt::format("each of {}", best->size()), best->size() == 1 ? "" : "s",
             1e2 * worst(*best, "lost_ratio"), ms_text(worst(*best, "round_trip_s_p50")),
             ms_text(worst(*best, "round_trip_s_p99")), ms_text(worst(*best, "gap_s")));
}

}  // namespace

std::string command_of(const NetworkCell& cell, const NetworkRunSettings& settings) {
  return fmt::format("subworld lab network {} --duration {} --seed {}", options_of(cell), settings.duration_s,
                     settings.seed);
}

Json row_of(const NetworkCell& cell, const NetworkRunSettings& settings, const CellFindings& found,
            const Baseline& baseline) {
  const bool measured = found.failure.empty();
  const bool linked = measured && found.link_packets > 0;
  const auto if_measured = [&](auto value) { return measured ? Json(value) : Json(); };
  Json row = columns_of(cell);
  row["measured_delay_s"] = linked ? Json(found.link_delay_s) : Json();
  row["measured_loss_ratio"] = linked ? Json(found.link_loss_ratio) : Json();
  row["link_packets"] = linked ? Json(found.link_packets) : Json();
  row["duration_s"] = settings.duration_s;
  row["sent"] = if_measured(found.sent);
  row["sent_ratio"] = over(found.sent, found.planned);
  row["refused"] = if_measured(found.refused);
  row["received"] = if_measured(found.there.received);
  row["lost"] = if_measured(lost(found, found.there));
  row["lost_ratio"] = over(lost(found, found.there), found.sent);
  row["lost_burst"] = if_measured(found.there.longest_burst);
  row["duplicates"] = if_measured(found.there.duplicates);
  row["out_of_order"] = if_measured(found.there.out_of_order);
  row["gap_s"] = if_measured(found.there.longest_gap_s);
  row["to_user_s"] = percentiles(found.there.delay);
  row["to_world_s"] = percentiles(found.back);
  row["round_trip_s"] = percentiles(found.round_trip.delay);
  row["round_trip_lost_ratio"] = over(lost(found, found.round_trip), found.sent);
  row["round_trip_gap_s"] = if_measured(found.round_trip.longest_gap_s);
  row["deadline_missed"] = if_measured(found.deadline_missed);
  row["liveliness_lost"] = if_measured(found.liveliness_lost);
  row["world_cpu_ratio"] = if_measured(found.world_cpu_ratio);
  row["haptic_cpu_ratio"] = if_measured(found.haptic_cpu_ratio);
  row["link_cpu_ratio"] = linked ? Json(found.link_cpu_ratio) : Json();
  row["baseline_round_trip_s"] = percentiles(baseline.udp.round_trip.delay);
  row["baseline_lost_ratio"] = over(lost(baseline.udp, baseline.udp.there), baseline.udp.sent);
  row["ddsperf_round_trip_s"] = baseline.ddsperf.is_null() ? ddsperf_figures("", cell.rate_hz) : baseline.ddsperf;
  row["baseline_failure"] = baseline.udp.failure;
  row["failure"] = found.failure;
  row["qos"] = to_text(qos_of(cell));
  row["scheduling"] = found.scheduling;
  row["command"] = command_of(cell, settings);
  return row;
}

std::string result_text(const Json& row) {
  if (failed(row)) return "FAILED: " + row.at("failure").get<std::string>();
  return fmt::format("lost {:.2f} %, round trip p50 {} p99 {}, longest gap {}", 1e2 * value_of(row, "lost_ratio"),
                     ms_text(value_of(row, "round_trip_s_p50")), ms_text(value_of(row, "round_trip_s_p99")),
                     ms_text(value_of(row, "gap_s")));
}

std::string pair_of(const Json& row) {
  return row.at("world_dds").get<std::string>() + " > " + row.at("haptic_dds").get<std::string>();
}

bool failed(const Json& row) { return !row.at("failure").get<std::string>().empty(); }

std::vector<Rows> by_network(const Rows& rows) { return grouped(rows, {"transport", "link", "reliability"}); }

std::vector<Rows> by_link(const Rows& rows) { return grouped(rows, {"link"}); }

std::vector<std::string> sentences_of(const Rows& rows, const std::vector<Requirement>& requirements) {
  std::vector<std::string> sentences;
  for (const Rows& network : by_network(rows)) sentences.push_back(sentence_of(network, requirements));
  return sentences;
}

}  // namespace subworld

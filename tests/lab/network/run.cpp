#include "lab/network/run.hpp"

#include "io/results/json.hpp"
#include "lab/network/ddsperf.hpp"
#include "lab/network/report.hpp"
#include "lab/network/udp.hpp"
#include "lab/page/command_line.hpp"
#include "model/error.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <map>
#include <utility>

namespace subworld {

namespace {

/// The rows of an earlier run, by the command of their cell.
using KnownRows = std::map<std::string, Rows>;

/// Those of the same columns as `example`; cells that failed are measured again.
KnownRows known_rows(const std::string& file, const Json& example) {
  KnownRows known;
  if (!std::filesystem::exists(file)) return known;
  const auto names = [](const Json& row) {
    std::vector<std::string> found;
    for (const auto& [name, value] : row.items()) found.push_back(name);
    return found;
  };
  const std::vector<std::string> expected = names(example);
  for (const Json& row : read_json(file)) {
    if (row.is_object() && names(row) == expected) known[row.at("command").get<std::string>()].push_back(row);
  }
  std::erase_if(known, [](const auto& cell) { return std::ranges::any_of(cell.second, failed); });
  return known;
}

/// The baselines of a setting, measured once for the cells of its vendor pairs.
class Baselines {
 public:
  explicit Baselines(const NetworkRequest& request) : request_(request) {}
  /// How many `of` would measure.
  [[nodiscard]] int ahead(NetworkCell cell) const {
    cell.world_dds = cell.haptic_dds = kPlainUdp;
    return to_text(cell) == setting_ ? 0 : has_udp(cell) + request_.has_baseline(kDdsperf);
  }
  const Baseline& of(NetworkCell cell) {
    cell.world_dds = cell.haptic_dds = kPlainUdp;
    if (to_text(cell) == setting_) return found_;
    setting_ = to_text(cell);
    found_ = {};
    if (has_udp(cell)) found_.udp = measure_cell(cell, request_.settings);
    try {
      if (request_.has_baseline(kDdsperf)) found_.ddsperf = measure_ddsperf(cell, request_.settings);
    } catch (const Error& e) {
      found_.udp.failure = e.what();
    }
    return found_;
  }

 private:
  [[nodiscard]] bool has_udp(const NetworkCell& cell) const {
    return request_.has_baseline(kPlainUdp) && cell.payload_bytes <= kMostDatagram_bytes;
  }
  const NetworkRequest& request_;
  std::string setting_;
  Baseline found_;
};

class Lab {
 public:
  Lab(const NetworkPlan& plan, const NetworkRequest& request)
      : request_(request),
        all_(plan.size()),
        cells_file_(request.out + "/results.json"),
        felt_file_(request.out + "/felt.json") {
    if (!request.resume) {
      for (const std::string& file : {cells_file_, felt_file_, request.out + "/results.csv"})
        std::filesystem::remove(file);
    }
    take_known(plan);
    const std::string known = rows_.measured() > 0 ? fmt::format(", {} of them measured before", rows_.measured()) : "";
    const double work_s = planned_work_s();
    fmt::print("subworld lab network: {} cells{}, {}, results in {}\n", all_, known, about_text(work_s), request.out);
    std::fflush(stdout);
    left_ = TimeLeft(work_s);
  }

  NetworkRows operator()() {
    measure_messages();
    measure_scene();
    return std::move(rows_);
  }

 private:
  void take_known(const NetworkPlan& plan) {
    const KnownRows known_cells = known_rows(cells_file_, row_of({}, request_.settings, {}, {}));
    const KnownRows known_felt = known_rows(felt_file_, felt_row_of({}, request_.felt));
    for (const NetworkCell& cell : plan.cells) {
      if (const auto known = known_cells.find(command_of(cell, request_.settings)); known != known_cells.end())
        std::ranges::copy(known->second, std::back_inserter(rows_.cells));
      else
        cells_.push_back(cell);
    }
    for (const FeltCell& cell : plan.felt) {
      if (const auto known = known_felt.find(command_of(cell, request_.felt)); known != known_felt.end())
        add_felt(known->second);
      else
        felt_.push_back(cell);
    }
  }

  void add_felt(const Rows& users) {
    std::ranges::copy(users, std::back_inserter(rows_.felt));
    ++rows_.felt_cells;
  }

  [[nodiscard]] double planned_work_s() const {
    double sum_s = 0.0;
    std::string setting;
    for (const NetworkCell& cell : cells_) {
      const bool first = std::exchange(setting, setting_of(cell)) != setting_of(cell);
      sum_s += planned_s(cell, request_.settings) * (1 + (first ? Baselines(request_).ahead(cell) : 0));
    }
    for (const FeltCell& cell : felt_) sum_s += planned_s(cell, request_.felt);
    return sum_s;
  }

  void measure_messages() {
    Baselines baselines(request_);
    for (const NetworkCell& cell : cells_) {
      const double work_s = planned_s(cell, request_.settings) * (1 + baselines.ahead(cell));
      const Baseline& baseline = baselines.of(cell);
      const CellFindings found = measure_cell(cell, request_.settings);
      if (stop_signal() != 0) return;
      rows_.cells.push_back(row_of(cell, request_.settings, found, baseline));
      write_json(cells_file_, rows_.cells);
      report(to_text(cell), result_text(rows_.cells.back()), work_s);
    }
  }

  void measure_scene() {
    References references;
    for (const FeltCell& cell : felt_) {
      if (stop_signal() != 0) return;
      const Rows users = measure_felt(cell, request_.felt, references);
      if (users.empty()) return;
      add_felt(users);
      write_json(felt_file_, rows_.felt);
      report(to_text(cell, request_.felt), felt_result_text(users), planned_s(cell, request_.felt));
    }
  }

  void report(const std::string& cell, const std::string& result, double work_s) {
    done_s_ += work_s;
    fmt::print("[{:3}/{}] {}: {}{}\n", rows_.measured(), all_, cell, result, left_.text(done_s_));
    std::fflush(stdout);
  }

  const NetworkRequest& request_;
  std::size_t all_;
  std::string cells_file_, felt_file_;
  std::vector<NetworkCell> cells_;  ///< to be measured
  std::vector<FeltCell> felt_;
  NetworkRows rows_;
  TimeLeft left_{0.0};
  double done_s_ = 0.0;
};

}  // namespace

bool NetworkRequest::has_baseline(const std::string& name) const {
  return std::ranges::find(baselines, name) != baselines.end();
}

NetworkPlan plan_of(const NetworkRequest& request) {
  NetworkPlan plan{.cells = cells_of(request.axes), .felt = felt_cells_of(request.axes, request.felt)};
  check_scene(request.felt);
  if (!request.messages) plan.cells.clear();
  return plan;
}

std::size_t NetworkRows::failed_cells() const {
  const auto first_user = [](const Json& row) { return row.at("user") == 0 && failed(row); };
  return static_cast<std::size_t>(std::ranges::count_if(cells, failed) + std::ranges::count_if(felt, first_user));
}

NetworkRows measure_all(const NetworkPlan& plan, const NetworkRequest& request) { return Lab(plan, request)(); }

}  // namespace subworld

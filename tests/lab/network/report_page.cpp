#include "io/results/json.hpp"
#include "lab/network/report.hpp"

#include "lab/coupling/analysis.hpp"
#include "report/page.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace subworld {

namespace {

constexpr const char* kNetworkHowToRead =
    R"(<p>Each cell is one run: a world sends numbered, stamped messages to each user at a steady rate, on absolute
deadlines, and each user returns every message at once. World and users are processes of their own, each on an emulated
host, and use the same middleware layer as the product. <b>The start-up is excluded</b>: discovery, and the messages of
the first 0.5 s. The <b>round trip</b> is the time from before the write until the world's thread has the returned message.
A <b>lost</b> message did not reach the user; one that the middleware refused counts as lost. The <b>gap</b> is the
longest time between two arrivals at a user. A percentile is shown only where at least ten samples lie beyond it. Late
wake-ups on a busy machine are part of all times.</p>
<p><b>UDP</b> is the baseline: the same messages as plain datagrams, measured in the same way over the same link, before
the vendors. <b>ddsperf</b> is the round trip that the measuring program of Cyclone DDS finds there.</p>
<p>The <b>measured link</b> counts all packets between the hosts, also those of discovery and repetition. The CPU time is that
of a process, in seconds a second.</p>
)";

constexpr std::array kPairColours{"#0072b2", "#d55e00", "#009e73", "#cc79a7"};

struct Shown {
  const char* title;
  const char* y_label;
  const char* column;
  double scale;
  bool log_y;
};
constexpr std::array kShown{Shown{"round trip, median", "round trip p50, ms", "round_trip_s_p50", 1e3, true},
                            Shown{"round trip, 99th percentile", "round trip p99, ms", "round_trip_s_p99", 1e3, true},
                            Shown{"lost messages", "lost, %", "lost_ratio", 1e2, false},
                            Shown{"longest gap", "longest gap, ms", "gap_s", 1e3, true}};

constexpr std::array kNetworkTable{
    Column{"rate Hz", "rate_hz", 1.0, 6},
    Column{"bytes", "payload_bytes", 1.0, 7},
    Column{"users", "users", 1.0, 2},
    Column{"depth", "depth", 1.0, 4},
    Column{"link delay ms", "delay_s", 1e3, 4},
    Column{"measured ms", "measured_delay_s", 1e3, 4},
    Column{"link loss %", "loss_ratio", 1e2, 3},
    Column{"measured %", "measured_loss_ratio", 1e2, 3},
    Column{"sent", "sent", 1.0, 9},
    Column{"lost %", "lost_ratio", 1e2, 3},
    Column{"lost in a row", "lost_burst", 1.0, 6},
    Column{"gap ms", "gap_s", 1e3, 4},
    Column{"to user p50 ms", "to_user_s", 1e3, 3, "p50"},
    Column{"round trip p50 ms", "round_trip_s", 1e3, 3, "p50"},
    Column{"p90 ms", "round_trip_s", 1e3, 3, "p90"},
    Column{"p99 ms", "round_trip_s", 1e3, 3, "p99"},
    Column{"p99.9 ms", "round_trip_s", 1e3, 3, "p99_9"},
    Column{"p99.99 ms", "round_trip_s", 1e3, 3, "p99_99"},
    Column{"max ms", "round_trip_s", 1e3, 3, "max"},
    Column{"samples", "round_trip_s", 1.0, 9, "n"},
    Column{"UDP p50 ms", "baseline_round_trip_s", 1e3, 3, "p50"},
    Column{"UDP p99 ms", "baseline_round_trip_s", 1e3, 3, "p99"},
    Column{"UDP lost %", "baseline_lost_ratio", 1e2, 3},
    Column{"ddsperf p50 ms", "ddsperf_round_trip_s", 1e3, 3, "p50"},
    Column{"ddsperf p99 ms", "ddsperf_round_trip_s", 1e3, 3, "p99"},
    Column{"deadlines missed", "deadline_missed", 1.0, 7},
    Column{"liveliness lost", "liveliness_lost", 1.0, 7},
    Column{"CPU world", "world_cpu_ratio", 1.0, 2},
    Column{"CPU user", "haptic_cpu_ratio", 1.0, 2},
};

/// What differs from one point of a plot to the next.
std::string load_of(const Json& row) {
  return fmt::format("{:g} Hz\n{} B x {}\ndepth {}", row.at("rate_hz").get<double>(),
                     row.at("payload_bytes").get<int>(), row.at("users").get<int>(), row.at("depth").get<int>());
}

Plot plot_of(const Shown& shown, const Rows& network) {
  Plot plot{.title = shown.title,
            .x_label = "load",
            .y_label = shown.y_label,
            .log_y = shown.log_y,
            .x_ticks = {},
            .x_names = {},
            .series = {},
            .levels = {}};
  for (const Json& row : network) {
    const std::string load = load_of(row), pair = pair_of(row);
    const auto x = std::ranges::find(plot.x_names, load) - plot.x_names.begin();
    if (x == static_cast<std::ptrdiff_t>(plot.x_names.size())) plot.x_names.push_back(load);
    auto line = std::ranges::find(plot.series, pair, &Series::title);
    if (line == plot.series.end()) {
      plot.series.push_back({.title = pair, .colour = kPairColours[plot.series.size() % 4], .points = {}});
      line = plot.series.end() - 1;
    }
    const double y = shown.scale * value_of(row, shown.column);
    if (std::isfinite(y) && (y > 0.0 || !shown.log_y)) line->points.emplace_back(static_cast<double>(x + 1), y);
  }
  std::erase_if(plot.series, [](const Series& line) { return line.points.empty(); });
  return plot;
}

std::string table_of(const Rows& network) {
  TextTable table{.head = {"vendors"}, .remarks = true};
  for (const Column& column : kNetworkTable) table.head.emplace_back(column.title);
  table.head.emplace_back("quality of service; command");
  for (const Json& row : network) {
    std::vector<std::string> cells{escaped(pair_of(row))};
    for (const Column& column : kNetworkTable) cells.push_back(cell_of(column, row));
    cells.push_back(escaped((failed(row) ? "FAILED: " + row.at("failure").get<std::string>() + "; " : "") +
                            row.at("qos").get<std::string>() + "; " + row.at("command").get<std::string>()));
    table.rows.push_back(std::move(cells));
  }
  return html_of(table);
}

constexpr const char* kFeltHowToRead =
    R"(<p>The real programs run the scene in real time, with the world and each user on an emulated host of their own. The
force on each operator is compared with that of a <b>reference</b>: the same motions in one world, without a network.
Errors below the <b>reference error</b> are not significant. Deadlines that the programs missed are those of this
machine, not of the link. A run with a missed gate was repeated, up
to three times, unless the network or the scene missed it.</p>
)";

constexpr std::array kFeltTable{
    Column{"RMS error %", "force_error_rms", 1e2, 3},
    Column{"p99 %", "force_error_p99", 1e2, 3},
    Column{"max %", "force_error_max", 1e2, 3},
    Column{"time offset ms", "time_offset_s", 1e3, 3},
    Column{"RMS without it %", "value_offset", 1e2, 3},
    Column{"reference error %", "reference_error", 1e2, 3},
    Column{"created mJ", "created_j", 1e3, 3},
    Column{"in the reference mJ", "reference_created_j", 1e3, 3},
    Column{"energy excess mJ", "energy_excess_j", 1e3, 3},
    Column{"in the reference mJ", "reference_energy_excess_j", 1e3, 3},
    Column{"missed deadlines", "missed_deadlines", 1.0, 7},
    Column{"lost frames", "lost_frames", 1.0, 7},
    Column{"late reports %", "late_reports_ratio", 1e2, 3},
    Column{"attempts", "attempts", 1.0, 2},
};

std::string felt_table_of(const Rows& felt) {
  TextTable table{.head = {"link", "vendors", "user"}, .texts = 3, .remarks = true};
  for (const Column& column : kFeltTable) table.head.emplace_back(column.title);
  table.head.emplace_back("verdict; command");
  for (const Json& row : felt) {
    std::vector<std::string> cells{escaped(row.at("link")), escaped(pair_of(row)), escaped(row.at("user_name"))};
    for (const Column& column : kFeltTable) cells.push_back(cell_of(column, row));
    cells.push_back(escaped(
        (failed(row) ? "FAILED: " + row.at("failure").get<std::string>() : row.at("verdict").get<std::string>()) +
        "; " + row.at("command").get<std::string>()));
    table.rows.push_back(std::move(cells));
  }
  return html_of(table);
}

/// The largest error of all users against the link, for each vendor pair.
Plot felt_plot_of(const Rows& felt) {
  Plot plot{.title = "felt force",
            .x_label = "link",
            .y_label = "RMS error of the force, %",
            .log_y = true,
            .x_ticks = {},
            .x_names = {},
            .series = {},
            .levels = {{"imperceptible", "#b8860b", 1e2 * kImperceptibleRms}}};
  for (const Rows& link : by_link(felt)) {
    plot.x_names.push_back(link.front().at("link"));
    std::map<std::string, double> worst;
    for (const Json& row : link) {
      const double error = 1e2 * value_of(row, "force_error_rms");
      if (error > 0.0) worst[pair_of(row)] = std::max(worst[pair_of(row)], error);
    }
    for (const auto& [pair, error] : worst) {
      auto line = std::ranges::find(plot.series, pair, &Series::title);
      if (line == plot.series.end()) {
        plot.series.push_back({.title = pair, .colour = kPairColours[plot.series.size() % 4], .points = {}});
        line = plot.series.end() - 1;
      }
      line->points.emplace_back(static_cast<double>(plot.x_names.size()), error);
    }
  }
  return plot;
}

void add_felt(Page& page, const Rows& felt, const Json& summary) {
  if (felt.empty()) return;
  page.heading("What users feel");
  page.add(fmt::format("<p class=choice>{}</p>\n", escaped(summary.at("felt"))));
  page.add(kFeltHowToRead);
  if (const Plot plot = felt_plot_of(felt); !plot.series.empty()) {
    const std::vector<std::string> picture = svg_of({plot});
    page.plots(picture.data(), 1);
  }
  page.add(felt_table_of(felt));
}

}  // namespace

void write_network_report(const std::string& path, const Rows& rows, const Rows& felt, const Json& summary) {
  const std::vector<Rows> networks = by_network(rows);
  std::vector<std::vector<Plot>> plots;
  std::vector<Plot> all;
  for (const Rows& network : networks) {
    std::vector<Plot>& mine = plots.emplace_back();
    for (const Shown& shown : kShown) {
      Plot plot = plot_of(shown, network);
      if (!plot.series.empty()) mine.push_back(std::move(plot));
    }
    all.insert(all.end(), mine.begin(), mine.end());
  }
  const std::vector<std::string> pictures = all.empty() ? std::vector<std::string>{} : svg_of(all);
  Page page(path, "What can this network carry?");
  page.intro("Messages between a world and its users, for each network, service, load and pair of vendors", summary);
  if (!rows.empty()) page.add(kNetworkHowToRead);
  std::size_t first = 0;
  for (std::size_t i = 0; i < networks.size(); ++i) {
    const Json& any = networks[i].front();
    page.heading(fmt::format("{} {}, {}", any.at("transport").get<std::string>(), any.at("link").get<std::string>(),
                             any.at("reliability").get<std::string>()));
    page.add(fmt::format("<p class=choice>{}</p>\n", escaped(summary.at("sentences").at(i).get<std::string>())));
    page.plots(pictures.data() + first, plots[i].size());
    first += plots[i].size();
    page.add(table_of(networks[i]));
  }
  add_felt(page, felt, summary);
  page.close();
}

}  // namespace subworld

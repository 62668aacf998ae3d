#include "io/results/json.hpp"
#include "results/run_report.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

namespace subworld {

namespace {

/// A figure of a table, and what it means. The value is scaled from SI.
struct Figure {
  const char* title;
  const char* unit;
  const char* path;
  double scale;
  int digits;
  const char* about;
  bool only_above_zero = false;  ///< omitted where it is zero everywhere

  [[nodiscard]] std::string head() const { return fmt::format("{}{}{}", title, *unit == 0 ? "" : " ", unit); }
};

constexpr std::array kForceFigures{
    Figure{"force RMS", "N", "haptic/force_rms_n", 1, 4, "force that was sent to the device: root mean square"},
    Figure{"force max", "N", "haptic/force_max_n", 1, 4, "largest force that was sent to the device"},
    Figure{"largest step", "N", "haptic/force_step_max_n", 1, 3,
           "largest change of that force from one step to the next"},
    Figure{"at the limit", "%", "haptic/at_limit_ratio", 1e2, 3,
           "share of the steps with the device at its force or torque limit"},
    Figure{"coupling RMS", "N", "haptic/coupling_force_rms_n", 1, 4, "force of the coupling on the proxy"},
    Figure{"oscillation", "N RMS", "haptic/oscillation_n", 1, 3,
           "force that oscillates faster than 15 Hz for a second"},
    Figure{"work", "J", "haptic/device_work_j", 1, 3,
           "work of the user on the coupling or, with an admittance device, on the proxy"},
    Figure{"created", "mJ", "haptic/operator_energy/created_j", 1e3, 3,
           "energy delivered to the operator beyond what the coupling could store and other operators had put in"},
    Figure{"proxy apart", "mm", "haptic/proxy_apart_max_m", 1e3, 3, "largest distance between proxy and device"},
    Figure{"device jumps", "", "haptic/device_jumps", 1, 6,
           "steps with a device state that no operator can have reached", true},
    Figure{"energy bounded", "%", "device/energy_bounded_ratio", 1e2, 3,
           "share of the steps in which the bound on the energy of the device acted", true}};

constexpr std::array kTimeFigures{
    Figure{"steps", "", "haptic/steps", 1, 9, "haptic steps"},
    Figure{"missed", "", "haptic/missed_deadlines", 1, 9, "steps whose force left after the end of their period"},
    Figure{"by the run", "", "haptic/missed_by_run", 1, 9, "missed deadlines that the run itself caused"},
    Figure{"by the OS", "", "haptic/missed_by_os", 1, 9, "missed deadlines that the operating system caused"},
    Figure{"skipped", "", "haptic/skipped_steps", 1, 9, "periods that ended before their step could begin", true},
    Figure{"lateness p50", "ms", "haptic/lateness_s/p50", 1e3, 3,
           "delay of the start of a step: half of the steps have less", true},
    Figure{"lateness p99", "ms", "haptic/lateness_s/p99", 1e3, 3, "99 of 100 steps have less", true},
    Figure{"lateness max", "ms", "haptic/lateness_s/max", 1e3, 3, "largest delay of the start of a step", true},
    Figure{"step p50", "ms", "haptic/step_s/p50", 1e3, 3, "time of the work of a step: half of the steps take less"},
    Figure{"step p99", "ms", "haptic/step_s/p99", 1e3, 3, "99 of 100 steps take less"},
    Figure{"step max", "ms", "haptic/step_s/max", 1e3, 3, "longest step"},
    Figure{"device round trip p99", "ms", "device/round_trip_s/p99", 1e3, 3,
           "time from a state of the device to the command that answers it"},
    Figure{"device missed", "", "device/missed_deadlines", 1, 9, "deadlines that the loop of the device missed"}};

constexpr std::array kSubWorldFigures{
    Figure{"members mean", "", "haptic/members/mean", 1, 3, "bodies in the sub-world"},
    Figure{"members max", "", "haptic/members/max", 1, 4, "most bodies in the sub-world"},
    Figure{"border pairs mean", "", "haptic/border_pairs/mean", 1, 3,
           "contacts between bodies of the sub-world and the rest of the world"},
    Figure{"border pairs max", "", "haptic/border_pairs/max", 1, 4, "most such contacts"},
    Figure{"contacts mean", "", "haptic/contacts/mean", 1, 4, "contacts in the sub-world"},
    Figure{"synchronisation p99", "ms", "haptic/sync_s/p99", 1e3, 3, "time to take in a frame of the world"},
    Figure{"round trip p99", "ms", "haptic/round_trip_s/p99", 1e3, 3,
           "time from a report to the frame that answers it"},
    Figure{"payload", "kB/cycle", "haptic/bytes_per_cycle", 1e-3, 3, "payload from and to the world in a cycle"},
    Figure{"late reports", "%", "haptic/late_reports_ratio", 1e2, 3,
           "share of the frames at which the world did not have the report of that time, and guessed", true},
    Figure{"lost frames", "", "haptic/lost_frames", 1, 9, "frames that were missing when a later one arrived"},
    Figure{"resynchronised", "", "haptic/resynchronisations", 1, 9, "restarts from the states of the world", true},
    Figure{"device samples sent", "%", "device/sent_ratio", 1e2, 3,
           "share of the states of the device that were sent"}};

constexpr std::array kWorldFigures{
    Figure{"bodies", "", "world/bodies", 1, 9, "bodies of the scene"},
    Figure{"cycles", "", "world/cycles", 1, 9, "steps of the exchange between world and sub-worlds"},
    Figure{"simulation ratio, mean", "", "world/ratio/mean", 1, 4, "cycle of the world over the haptic step"},
    Figure{"sub-steps, mean", "", "world/substeps/mean", 1, 4, "steps of the engine in a cycle"},
    Figure{"cycle p50", "ms", "world/step_s/p50", 1e3, 3, "time of the work of a cycle: half of the cycles take less"},
    Figure{"cycle p99", "ms", "world/step_s/p99", 1e3, 3, "99 of 100 cycles take less"},
    Figure{"cycle max", "ms", "world/step_s/max", 1e3, 3, "longest cycle"},
    Figure{"lateness p99", "ms", "world/lateness_s/p99", 1e3, 3, "delay of the start of a cycle: 99 of 100 have less",
           true},
    Figure{"late cycles", "", "world/late_cycles", 1, 9, "cycles that ended late"},
    Figure{"late by the run", "", "world/late_by_run", 1, 9, "late cycles that the run itself caused", true},
    Figure{"late by the OS", "", "world/late_by_os", 1, 9, "late cycles that the operating system caused", true},
    Figure{"real-time factor, least", "", "world/real_time_factor_min", 1, 4, "simulated time over wall time"},
    Figure{"real-time factor, mean", "", "world/real_time_factor_mean", 1, 4, "mean over the run"},
    Figure{"slowed", "s", "world/slowed_s", 1, 3, "wall time with a factor below 1", true},
    Figure{"energy excess", "J", "haptic/0/energy_excess_j", 1, 3,
           "largest energy that the bodies gained beyond the work of the users"},
    Figure{"released", "J", "world/released_j", 1, 3,
           "energy that falling or braked bodies can have given to an operator"},
    Figure{"created at all operators", "J", "world/operators_created_j", 1, 3,
           "energy that all operators received beyond what they had put in and the couplings could store"},
    Figure{"asleep at the end", "", "world/asleep_at_end", 1, 9, "bodies that were asleep at the end"},
    Figure{"lost reports", "", "world/lost_reports", 1, 9, "reports of users that did not arrive"},
    Figure{"refused reports", "", "world/refused_reports", 1, 9, "reports that were not of this run", true},
    Figure{"checkpoints", "", "world/checkpoints/written", 1, 9, "checkpoints that were written", true},
    Figure{"checkpoints that failed", "", "world/checkpoints/failed", 1, 9, "checkpoints that could not be written",
           true},
    Figure{"settling", "s", "world/settle_wall_s", 1, 3, "wall time of the settling before t = 0"}};

bool is_shown(const Figure& figure, const std::vector<Json>& rows) {
  return std::ranges::any_of(rows, [&](const Json& row) {
    const double value = number_at(row, figure.path);
    return std::isfinite(value) && (!figure.only_above_zero || value > 0.0);
  });
}

std::string table_of(const std::string& name, const std::vector<Json>& users, std::span<const Figure> figures) {
  TextTable table{.head = {"user"}, .name = name, .about = {"name in the scene"}};
  for (const Json& user : users) table.rows.push_back({escaped(text_at(user, "name"))});
  for (const Figure& figure : figures) {
    if (!is_shown(figure, users)) continue;
    table.head.push_back(figure.head());
    table.about.emplace_back(figure.about);
    for (std::size_t u = 0; u < users.size(); ++u)
      table.rows[u].push_back(shown(figure.scale * number_at(users[u], figure.path), figure.digits));
  }
  return table.head.size() > 1 ? html_of(table) : "";
}

/// When a user did not take part: "0.5 to 1.2 s".
std::string absences_of(const Json& summary, const std::string& user) {
  std::string text;
  for (const Json& absence : value_at(summary, "world/absences")) {
    if (text_at(absence, "user") != user) continue;
    text += fmt::format("{}{} to {} s{}", text.empty() ? "" : "; ", digits_of(number_at(absence, "from_s"), 4),
                        digits_of(number_at(absence, "to_s"), 4),
                        text_at(absence, "by_order") == "true" ? " (asked to leave)" : "");
  }
  return text.empty() ? "none" : text;
}

std::string device_of(const Json& user) {
  const std::string driver = text_at(user, "device/driver/name"), version = text_at(user, "device/driver/version");
  return driver.empty() ? "emulated operator" : driver + (version.empty() ? "" : " " + version);
}

std::string or_dash(const std::string& text) { return text.empty() ? "&ndash;" : escaped(text); }

/// Events of the middleware that happened: "lost 3, refused 1".
std::string events_of(const Json& program) {
  std::string text;
  const Json& events = value_at(program, "events");
  if (!events.is_object()) return "&ndash;";
  for (const auto& [event, count] : events.items()) {
    if (!count.is_number() || count == 0) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", event, json_text(count));
  }
  std::ranges::replace(text, '_', ' ');
  return text.empty() ? "none" : escaped(text);
}

std::string vendor_of_program(const Json& program) {
  const std::string text = text_at(program, "dds");
  if (text.empty()) return "&ndash;";
  return text.find("cyclonedds") == std::string::npos ? "fastdds" : "cyclonedds";
}

std::vector<std::string> program_row(const std::string& name, const Json& program) {
  const std::string fault = text_at(program, "ending/fault");
  const std::string end = fault.empty() ? text_at(program, "ending/by") : fault;
  return {escaped(name),
          or_dash(text_at(program, "host")),
          vendor_of_program(program),
          or_dash(text_at(program, "machine/scheduling")),
          shown(number_at(program, "machine/cpu_s"), 3),
          shown(1e3 * number_at(program, "machine/run_queue_delay_s"), 3),
          shown(number_at(program, "machine/involuntary_switches"), 9),
          shown(number_at(program, "ending/from_s"), 4),
          shown(number_at(program, program.contains("ending") ? "ending/to_s" : "to_s"), 6),
          events_of(program),
          text_at(program, "partial") == "true" ? "killed, or its results could not be written" : or_dash(end)};
}

}  // namespace

const Json& value_at(const Json& json, const std::string& path) {
  static const Json kNone;
  const Json::json_pointer at(path.empty() ? "" : "/" + path);
  return json.contains(at) ? json.at(at) : kNone;
}

double number_at(const Json& json, const std::string& path) {
  const Json& value = value_at(json, path);
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

std::string text_at(const Json& json, const std::string& path) {
  const Json& value = value_at(json, path);
  return value.is_null() ? "" : value.is_string() ? value.get<std::string>() : json_text(value);
}

std::vector<Json> users_of(const Json& summary) {
  std::vector<Json> users;
  const Json& haptic = value_at(summary, "haptic");
  const Json& settings = value_at(summary, "settings/users");
  const std::size_t count = haptic.is_array() ? haptic.size() : settings.is_array() ? settings.size() : 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::string place = std::to_string(i);
    Json user;
    if (haptic.is_array()) user["haptic"] = haptic[i];
    if (const Json& device = value_at(summary, "device/" + place); !device.is_null()) user["device"] = device;
    const std::string number = text_at(user, "haptic/user");
    user["user"] = number.empty() ? place : number;
    user["settings"] = value_at(summary, "settings/users/" + text_at(user, "user"));
    const std::string name = text_at(user, "settings/name");
    user["name"] = name.empty() ? "user " + text_at(user, "user") : name;
    users.push_back(std::move(user));
  }
  return users;
}

std::string user_tables(const Json& summary, const std::vector<Json>& users) {
  if (users.empty()) return "<p>There are no results of users.</p>\n";
  TextTable who{.head = {"user", "device", "host", "force limit N", "rate Hz", "absences"},
                .texts = 3,
                .remarks = true,
                .name = "users",
                .about = {"name in the scene", "emulated, or its driver", "machine of the haptic process",
                          "of the device", "of the device", "simulated times in which the user did not take part"}};
  for (const Json& user : users) {
    who.rows.push_back({escaped(text_at(user, "name")), escaped(device_of(user)), or_dash(text_at(user, "haptic/host")),
                        shown(number_at(user, "settings/device/force_limit_n"), 4),
                        shown(number_at(user, "settings/device/rate_hz"), 6),
                        escaped(absences_of(summary, text_at(user, "user")))});
  }
  return html_of(who) + "<h3>Force and energy</h3>\n" + table_of("force", users, kForceFigures) +
         "<h3>Time of the haptic loop</h3>\n" + table_of("time", users, kTimeFigures) +
         "<h3>Sub-world and messages</h3>\n" + table_of("sub_world", users, kSubWorldFigures);
}

std::string world_table(const Json& summary) {
  TextTable table{.head = {"figure", "value", "unit", "meaning"}, .remarks = true, .name = "world"};
  const std::vector<Json> whole(1, summary);
  for (const Figure& figure : kWorldFigures) {
    if (!is_shown(figure, whole)) continue;
    table.rows.push_back({escaped(figure.title), shown(figure.scale * number_at(summary, figure.path), figure.digits),
                          figure.unit, escaped(figure.about)});
  }
  return table.rows.empty() ? "<p>There are no results of the world.</p>\n" : html_of(table);
}

std::string program_table(const Json& summary, const std::vector<Json>& users) {
  TextTable table{.head = {"program", "host", "DDS vendor", "scheduling", "CPU s", "ready without a core ms",
                           "pre-empted", "from s", "to s", "DDS events", "ended by"},
                  .texts = 4,
                  .remarks = true,
                  .name = "programs",
                  .about = {"", "", "", "that the operating system granted", "of the loop's thread",
                            "time in which the loop could run but had no core", "times that the OS took the core away",
                            "simulated time", "simulated time", "", ""}};
  if (const Json& world = value_at(summary, "world"); world.is_object())
    table.rows.push_back(program_row("world_sim", world));
  for (const Json& user : users) {
    for (const char* kind : {"haptic", "device"}) {
      const Json& program = value_at(user, kind);
      if (program.is_object())
        table.rows.push_back(program_row(fmt::format("{}_sim {}", kind, text_at(user, "user")), program));
    }
  }
  return table.rows.empty() ? "" : html_of(table);
}

}  // namespace subworld

#include "results/run_report.hpp"

#include "io/results/json.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

namespace subworld {

namespace fs = std::filesystem;

namespace {

using Facts = std::vector<std::pair<std::string, std::string>>;

constexpr const char* kAbout =
    "<p>One process simulates the <b>world</b>, all bodies at a coarse time step. For each <b>user</b>, another "
    "process "
    "simulates the bodies near the tool at the rate of the haptic device, and a <b>coupling scheme</b> keeps the two "
    "consistent. {}</p>\n";
constexpr const char* kLockstep =
    "In <b>lock-step</b> the processes advance together, independent of wall time: the forces repeat bit by bit, and "
    "the "
    "times of steps are costs, not deadlines.";
constexpr const char* kRealTime =
    "In <b>real time</b> all loops run on absolute deadlines and never wait for each other: the result depends on the "
    "machine and its load.";

constexpr const char* kMore =
    "<p>Point at the title of a column for its meaning. Click on it to sort. All keys of the summary are defined in "
    "<code>deploy/README.md#summaryjson</code> of Subworld.</p>\n";

constexpr const char* kCurves =
    "<p class=facts>Of each of up to 720 intervals, a curve has the least and the largest value.</p>\n";
constexpr const char* kLateSteps =
    "<p class=facts>Missed deadlines are among the late steps: a step whose force left in time may still end "
    "late.</p>\n";

/// A unit of the summary, and one that is easier to read.
struct Readable {
  const char* si;
  const char* unit;
  double scale;
};
constexpr std::array kReadable{Readable{"s", "ms", 1e3}, Readable{"ratio", "%", 1e2}, Readable{"1", "", 1.0}};

bool is_realtime(const Json& summary) { return text_at(summary, "mode") == "realtime"; }

/// The class of a verdict's paragraph.
const char* class_of(const std::string& verdict) {
  if (verdict == "ok" || verdict.starts_with("ok;")) return "choice";
  return verdict.starts_with("stopped") ? "doubt" : "fault";
}

std::string verdict_of(const Json& summary) {
  const std::string verdict = text_at(summary, "verdict");
  std::string text = fmt::format("<p class=\"verdict {}\">Verdict: <b>{}</b></p>\n", class_of(verdict),
                                 verdict.empty() ? "none" : escaped(verdict));
  if (text_at(summary, "partial") == "true") {
    text +=
        "<p class=doubt>The run has no orderly end. The figures are those of the programs until their end; of a "
        "program "
        "that was killed, only what follows from its history.</p>\n";
  }
  return text;
}

std::string gates_of(const Json& summary) {
  const Json& gates = value_at(summary, "gates");
  if (!gates.is_array() || gates.empty()) return "<p>No gates: a run is judged only where it has an orderly end.</p>\n";
  std::vector<const Json*> sorted;
  for (const Json& gate : gates) sorted.push_back(&gate);
  const auto is_ok = [](const Json* gate) { return text_at(*gate, "ok") == "true"; };
  std::ranges::stable_partition(sorted, [&](const Json* gate) { return !is_ok(gate); });
  TextTable table{.head = {"gate", "result", "measured", "", "bound", "unit", "missed by, and why"},
                  .texts = 2,
                  .remarks = true,
                  .name = "gates",
                  .about = {"a measured value and its bound"}};
  for (const Json* gate : sorted) {
    const bool warns = text_at(*gate, "missed_by") == "scene";
    std::string why = text_at(*gate, "missed_by"), cause = text_at(*gate, "why");
    std::ranges::replace(why, '_', ' ');
    if (!cause.empty()) why += (why.empty() ? "" : ": ") + cause;
    const std::string si = text_at(*gate, "unit");
    const auto unit = std::ranges::find(kReadable, si, [](const Readable& one) { return std::string(one.si); });
    const double scale = unit == kReadable.end() ? 1.0 : unit->scale;
    table.rows.push_back({escaped(text_at(*gate, "name")),
                          is_ok(gate) ? "<span class=good>ok</span>"
                          : warns     ? "<span class=warn>warning</span>"
                                      : "<span class=bad>missed</span>",
                          shown(scale * number_at(*gate, "value"), 4),
                          text_at(*gate, "at_most") == "false" ? "&ge;" : "&le;",
                          shown(scale * number_at(*gate, "bound"), 4),
                          unit == kReadable.end() ? escaped(si) : unit->unit, escaped(why)});
  }
  const auto ok = std::ranges::count_if(sorted, is_ok);
  return fmt::format("<p>{} of {} quality gates ok.</p>\n", ok, sorted.size()) + html_of(table);
}

/// "bullet 3.24, preset quality"
std::string engine_text(const Json& summary, const std::string& key, const std::string& name) {
  const std::string path = "settings/" + key + "/", version = text_at(summary, path + "version");
  const std::string preset = text_at(summary, path + "preset");
  return text_at(summary, name) + (version.empty() ? "" : " (" + version + ")") +
         (preset.empty() ? "" : ", preset " + preset);
}

std::string ratio_of(const Json& summary) {
  const std::string least = text_at(summary, "ratio"), most = text_at(summary, "ratio_most");
  return most.empty() || most == least
             ? least
             : fmt::format("{} to {} (mean {})", least, most, digits_of(number_at(summary, "world/ratio/mean"), 3));
}

/// The artificial delay, and the seed of its draws; empty without one.
std::string delay_of(const Json& summary) {
  std::vector<std::string> texts;
  for (const auto& [key, words] : {std::pair{"up_s", "to the world"},
                                   {"down_s", "from the world"},
                                   {"from_device_s", "from the device"},
                                   {"to_device_s", "to the device"},
                                   {"jitter_s", "jitter"}}) {
    const double s = number_at(summary, fmt::format("settings/delay/{}", key));
    if (s > 0.0) texts.push_back(fmt::format("{} {} ms", words, digits_of(1e3 * s, 4)));
  }
  const double loss = number_at(summary, "settings/delay/loss_ratio");
  if (loss > 0.0) texts.push_back(fmt::format("loss {} %", digits_of(1e2 * loss, 3)));
  if (loss > 0.0 || number_at(summary, "settings/delay/jitter_s") > 0.0)
    texts.push_back("seed " + text_at(summary, "settings/delay/seed"));
  return joined(texts, ", ");
}

std::string hosts_of(const Json& summary) {
  std::vector<std::string> names;
  for (const Json& host : value_at(summary, "hosts")) {
    const double offset_s = number_at(host, "clock_offset_s");
    names.push_back(text_at(host, "host") +
                    (std::isfinite(offset_s) ? fmt::format(" (clock {:+.3g} ms)", 1e3 * offset_s) : ""));
  }
  if (!names.empty()) return joined(names, ", ");
  for (const char* kind : {"haptic", "device"}) {
    for (const Json& program : value_at(summary, kind)) {
      const std::string host = text_at(program, "host");
      if (!host.empty() && std::ranges::find(names, host) == names.end()) names.push_back(host);
    }
  }
  return joined(names, ", ");
}

std::string load_of(const Json& summary) {
  const double own = number_at(summary, "machine_load/own_cores");
  if (!std::isfinite(own)) return "";
  const double granted = number_at(summary, "machine_load/granted_cores");
  return fmt::format("{} by the run{}, {} by other programs, {} by other virtual machines", digits_of(own, 3),
                     std::isfinite(granted) ? fmt::format(" (its control group grants {})", digits_of(granted, 3)) : "",
                     digits_of(number_at(summary, "machine_load/other_cores"), 3),
                     digits_of(number_at(summary, "machine_load/stolen_cores"), 3));
}

std::string restarts_of(const Json& summary) {
  std::vector<std::string> texts;
  for (const Json& one : value_at(summary, "restarts"))
    texts.push_back(fmt::format("{} after {} s ({})", text_at(one, "program"), digits_of(number_at(one, "after_s"), 3),
                                text_at(one, "reason")));
  return joined(texts, "; ");
}

std::string list_of_words(const Json& words) {
  std::vector<std::string> texts;
  for (const Json& word : words) texts.push_back(text_at(word, ""));
  return joined(texts, ", ");
}

Facts facts_of(const Json& summary) {
  Facts facts;
  const auto add = [&](const char* name, const std::string& text) {
    if (!text.empty()) facts.emplace_back(name, escaped(text));
  };
  const auto number = [&](const char* path, double scale, const char* unit) {
    const double value = scale * number_at(summary, path);
    return std::isfinite(value) ? digits_of(value, 4) + unit : std::string();
  };
  add("scene", text_at(summary, "scene"));
  add("scene file", text_at(summary, "scene_file"));
  add("mode", is_realtime(summary) ? "real time" : "lock-step");
  add("coupling scheme", text_at(summary, "scheme"));
  add("engine of the world", engine_text(summary, "world_engine", "engine"));
  add("engine of the sub-worlds", engine_text(summary, "haptic_engine", "haptic_engine"));
  add("DDS vendor", text_at(summary, "dds"));
  add("simulation ratio", ratio_of(summary));
  add("haptic step", number("h_s", 1e3, " ms"));
  add("users", text_at(summary, "users"));
  add("requested length", number("duration_s", 1.0, " s"));
  add("simulated", number("simulated_s", 1.0, " s"));
  add("wall time", number("wall_s", 1.0, " s"));
  add("artificial delay", delay_of(summary));
  add("emulated link", text_at(summary, "link"));
  add("passivity", text_at(summary, "settings/passivity"));
  add("disabled optimisations", list_of_words(value_at(summary, "settings/disabled")));
  add("users who came and went, and orders", text_at(summary, "presence"));
  add("programs started again", restarts_of(summary));
  add("display", text_at(summary, "display"));
  add("recording", text_at(summary, "recording/file"));
  add("session", text_at(summary, "session"));
  add("hosts", hosts_of(summary));
  add("cores in use", load_of(summary));
  add("state hash", text_at(summary, "state_hash"));
  add("version of Subworld", text_at(summary, "version"));
  add("command", text_at(summary, "command_line"));
  return facts;
}

/// The run in one line.
std::string line_of_run(const Json& summary) {
  const std::string users = text_at(summary, "users"), bodies = text_at(summary, "world/bodies");
  return fmt::format("{}{}, scheme {}, engine {}, {}{} user{}, r = {}, {}",
                     is_realtime(summary) ? "real time" : "lock-step",
                     std::isfinite(number_at(summary, "simulated_s"))
                         ? fmt::format(", {} s", digits_of(number_at(summary, "simulated_s"), 4))
                         : "",
                     text_at(summary, "scheme"), text_at(summary, "engine"),
                     bodies.empty() ? "" : bodies + (bodies == "1" ? " body, " : " bodies, "), users,
                     users == "1" ? "" : "s", ratio_of(summary), text_at(summary, "dds"));
}

std::string machine_line(const Json& summary) {
  const Json& machine = value_at(summary, "machine");
  return fmt::format("{} &middot; {}, {} cores, {} {}", escaped(text_at(summary, "date")),
                     escaped(text_at(machine, "cpu")), escaped(text_at(machine, "cores")),
                     escaped(text_at(machine, "system")), escaped(text_at(machine, "kernel")));
}

/// What the programs of a run write before it has a summary.
constexpr std::array kPartsOfARun{"world.json", "world.csv", "haptic_0.json", "haptic_0.csv", "device_0.csv", "hosts"};

/// The folder of the results that a path names.
fs::path folder_of(const std::string& what) {
  std::error_code ignored;
  if (fs::is_directory(what, ignored)) return what;
  if (!fs::exists(what, ignored)) {
    throw Error(ExitCode::usage, fmt::format("{}: no such folder or file; name the folder that a run, a session or a "
                                             "lab wrote its results to",
                                             what));
  }
  const fs::path folder = fs::path(what).parent_path();
  return folder.empty() ? "." : folder;
}

}  // namespace

ReportPlace place_of(const ReportRequest& request) {
  const fs::path folder = folder_of(request.what);
  const fs::path summary = folder / "summary.json";
  if (!fs::exists(summary)) {
    const bool ran = std::ranges::any_of(kPartsOfARun, [&](const char* part) { return fs::exists(folder / part); });
    throw Error(
        ExitCode::usage,
        fmt::format("{}: has no summary.json{}", folder.string(),
                    ran ? ": wait for its end if the run goes on; else `subworld collect` makes one of what its "
                          "programs wrote"
                        : ": no run and no lab has ended here; name the folder that its --out named"));
  }
  const Json json = read_json(summary.string());
  if (!json.is_object() || json.empty())
    throw Error(ExitCode::failed, fmt::format("{}: is no summary of a run or a lab", summary.string()));
  ReportPlace place{.folder = folder.string(), .page = request.out, .lab = ""};
  if (place.page.empty()) place.page = (folder / "report.html").string();
  if (fs::is_directory(place.page)) place.page = (fs::path(place.page) / "report.html").string();
  check_page(place.page);
  if (json.contains("lab") && json["lab"].is_string()) place.lab = json["lab"];
  if (place.lab.empty() && !json.contains("scene") && !json.contains("verdict"))
    throw Error(ExitCode::failed, fmt::format("{}: is no summary of a run or a lab", summary.string()));
  return place;
}

void write_report(const ReportPlace& place) {
  const Json summary = read_json(place.folder + "/summary.json");
  const std::vector<Json> users = users_of(summary);
  const std::vector<Plot> plots = plots_of_run(summary, users, place.folder);
  const std::vector<std::string> drawn = plots.empty() ? std::vector<std::string>{} : svg_of(plots);
  const std::string pictures = pictures_in(place.folder);

  Page page(place.page, "Run of the scene " + text_at(summary, "scene"));
  page.title();
  page.add(fmt::format("<p class=facts>{}<br>{}</p>\n", escaped(line_of_run(summary)), machine_line(summary)));
  page.add(verdict_of(summary) + gates_of(summary));
  page.heading("What was run");
  page.add(fmt::format(kAbout, is_realtime(summary) ? kRealTime : kLockstep) + html_of(facts_of(summary)));
  page.heading("Users");
  page.add(user_tables(summary, users));
  if (!drawn.empty()) {
    page.heading("Over time");
    page.plots(drawn.data(), drawn.size());
    page.add(is_realtime(summary) ? kCurves + std::string(kLateSteps) : kCurves);
  }
  page.heading("World");
  page.add(world_table(summary));
  if (const std::string programs = program_table(summary, users); !programs.empty()) {
    page.heading("Programs");
    page.add(programs);
  }
  if (!pictures.empty()) {
    page.heading("Pictures");
    page.add(pictures);
  }
  page.heading("What the figures mean");
  page.add(kMore);
  page.close();
  fmt::print("report: {}\n", place.page);
}

}  // namespace subworld

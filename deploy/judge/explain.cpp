#include "judge/explain.hpp"

#include "coupling/schemes/scheme.hpp"
#include "io/options/manual.hpp"
#include "judge/summary.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

std::string paragraph(const std::string& text) { return folded(text, 98, "  ") + "\n"; }

std::string rate_text(double hz) { return grouped(static_cast<std::uint64_t>(std::llround(hz))) + " Hz"; }

std::string scene_text(const RunResults& run) {
  const Settings& settings = run.scene.settings;
  const int users = settings.users;
  return fmt::format(
      "A world of {} {}, the scene \"{}\", was simulated for {:.3g} s{}. {} touched it with {} haptic device{}. "
      "The "
      "whole world was simulated in {} cycles a second; for each user, the bodies near the tool were simulated a "
      "second time, at {}.",
      grouped(run.world.bodies), run.world.bodies == 1 ? "body" : "bodies", run.scene.name, run.simulated_s,
      run.realtime() ? " in real time" : fmt::format(" in lock-step, in {:.1f} s", run.wall_s),
      users == 1 ? "An emulated operator" : fmt::format("{} emulated operators", users), users == 1 ? "a" : "one",
      users == 1 ? "" : " each", std::lround(1.0 / (settings.h_s * run.world.ratio.mean())),
      rate_text(1.0 / settings.h_s));
}

std::string user_text(const RunResults& run, const HapticResult& haptic) {
  std::string text = fmt::format(
      "{} felt {:.1f} N (RMS), at most {:.1f} N. {:.0f} bodies were near the tool on average, at most {:.0f}.",
      run.haptic.size() == 1 ? "The operator" : fmt::format("Operator {}", haptic.user), haptic.force_rms_n,
      haptic.force_max_n, haptic.members.mean(), haptic.members.max);
  if (!run.realtime()) return text;
  const std::uint64_t steps = haptic.steps + haptic.skipped_steps, late = haptic.missed_by_run + haptic.missed_by_os;
  if (late == 0) return text + fmt::format(" All of its {} forces left in time.", grouped(steps));
  return text + fmt::format(
                    " Of its {} forces, {} left in time ({:.4g} %). Of the others, the operating system delayed "
                    "{}, the simulation {}.",
                    grouped(steps), grouped(steps - std::min(steps, late)),
                    100.0 - 100.0 * static_cast<double>(late) / static_cast<double>(steps),
                    grouped(haptic.missed_by_os), grouped(haptic.missed_by_run));
}

/// What the run assumes about the network between its programs. The figures are those of haptic_sim: HeadStart, Phase.
std::string network_text(const RunResults& run) {
  const Settings& settings = run.scene.settings;
  if (!settings.remote && !settings.has_unknown_delay()) return {};
  const std::string link =
      run.link ? fmt::format(
                     "The hosts were namespaces of this machine, with an emulated link between any two, each "
                     "way: {}. ",
                     *run.link)
      : settings.remote ? "The programs ran on several hosts, with a network between them. "
                        : "The programs held their messages for an artificial delay. ";
  if (!run.realtime())
    return link + "In lock-step the programs wait for each message: the network costs time and changes no result.";
  if (!scheme_of(settings).properties.has_sub_worlds)
    return link + fmt::format("The scheme {} has no sub-world: the operator feels the world late by the round trip.",
                              settings.scheme);
  return link +
         "The plan assumes that the network delays and loses messages, and learns how much from the run: each "
         "sub-world is ahead of the world by the round trip (its head start, at most 0.5 s), so that the world has "
         "what the operator did when it needs it. Where one message in five is late, the head start grows. A message "
         "that is late by chance (jitter) does not change the pace: that follows the median of the newest 51 frames. "
         "Where no frame comes for more than about 25 cycles beyond that, the sub-world slows down, and then stops.";
}

}  // namespace

std::string explanation(const RunResults& run, const std::string& folder, bool pictured, const std::string& command) {
  std::string text = "\nWhat happened\n" + paragraph(scene_text(run));
  for (const HapticResult& haptic : run.haptic) text += paragraph(user_text(run, haptic));
  if (const std::string network = network_text(run); !network.empty()) text += paragraph(network);
  text +=
      paragraph(run.verdict.starts_with("ok") ? "All quality gates of the run itself were met."
                                              : "The verdict above is not \"ok\"; it names the cause and the cure.");
  text += "\nWhat to look at\n";
  const auto file = [&](const char* name, const char* what) {
    text += fmt::format("  {}/{}\n      {}\n", folder, name, what);
  };
  if (pictured) {
    file("picture.png",
         "the end of the run: red the tool, blue its sub-world, yellow the border, red lines the impulses of the rest");
  }
  file("haptic_0.csv", "every haptic step: force, positions, times; open it with a spreadsheet or pandas");
  file("summary.json", "all figures, settings and gates; deploy/README.md explains each");
  text += fmt::format(
      "\nWhat to try next\n"
      "  {0} run heap --mode realtime --users 2 --gui     # a second operator in the same heap\n"
      "  {0} run row --latency 0.05                       # a network delay of 50 ms, and the same force\n"
      "  {0} lab coupling --quick                         # the force error of each coupling scheme\n",
      command);
  return text;
}

}  // namespace subworld

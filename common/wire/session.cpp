#include "wire/session.hpp"

#include "model/error.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <random>
#include <utility>

namespace subworld {

namespace {

using namespace std::chrono_literals;

/// Which body differs from the world's, for an error text; empty: none, or not in what the description carries.
std::string bodies_differ(const Scene& scene, const SceneDescription& world) {
  if (world.bodies.size() != scene.bodies.size())
    return fmt::format("the scene has {} bodies, in the world {}", scene.bodies.size(), world.bodies.size());
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const std::string what = difference(settings_of(scene.bodies[i]), settings_of(world.bodies[i]), 1);
    if (!what.empty()) return fmt::format("of body {}, {}", scene.bodies[i].name, what);
  }
  return {};
}

constexpr std::size_t kMostUnknown = 256;
constexpr auto kMayBeEnding = 2s;  ///< a world of another run, whose last sample arrived recently

}  // namespace

std::uint64_t draw_identity() {
  std::random_device device;
  std::uint64_t drawn = 0;
  while (drawn == 0) drawn = (std::uint64_t{device()} << 32U) | device();
  return drawn;
}

std::string label_of(ProgramKind program, std::uint32_t instance) {
  constexpr std::array kNames{"world_sim", "haptic_sim", "device_sim", "gui_headless"};
  const char* name = kNames[static_cast<std::size_t>(program)];
  const bool one_per_user = program == ProgramKind::haptic_sim || program == ProgramKind::device_sim;
  return one_per_user ? fmt::format("{} {}", name, instance) : name;
}

std::string replaced_text(ProgramKind program, std::uint32_t instance) {
  return fmt::format(
      "{} was started again, or two of them are on this domain: its messages belong to another run or to another "
      "program; restart all programs of the run, or give one of the two another --domain",
      label_of(program, instance));
}

std::string displaced_text(ProgramKind peer, std::uint32_t instance) {
  return fmt::format(
      "{} serves another process in the place of this one: two programs of this user are on this domain; end one of "
      "them, or give it another --domain",
      label_of(peer, instance));
}

std::string SessionFinder::misfit(int domain) const {
  const SceneDescription& there = description_;
  if (there.wire_version != kWireVersion) {
    return fmt::format(
        "the world on domain {} has version {} of the messages, this program {}; install the same version of Subworld "
        "on all hosts",
        domain, there.wire_version, kWireVersion);
  }
  if (there.settings == settings_) return {};
  std::string what = bodies_differ(scene_, there);
  // A hash says less than the body that differs.
  const auto shown = [&](std::vector<NamedSetting> settings) {
    if (!what.empty()) std::erase_if(settings, [](const NamedSetting& setting) { return setting.name == "bodies"; });
    return settings;
  };
  if (const std::string other = difference(shown(settings_), shown(there.settings)); !other.empty())
    what = other + (what.empty() ? "" : "; ") + what;
  return fmt::format(
      "{}: the world on domain {} runs scene \"{}\" with other settings: {}. Give all programs the same file and the "
      "same flags",
      scene_.file, domain, there.name, what);
}

void SessionFinder::accept(std::uint64_t session, std::string misfit) {
  misfit_ = std::move(misfit);
  if (misfit_.empty()) {
    session_ = session;
  } else if (!other_) {
    other_ = std::chrono::steady_clock::now();
  }
}

bool SessionFinder::look(int domain) {
  while (reader_->take(description_) == Take::sample) {
    const std::uint64_t participant = reader_->sender_participant();
    std::erase_if(unknown_, [&](const Unknown& one) { return one.participant == participant; });
    if (unknown_.size() >= kMostUnknown) unknown_.erase(unknown_.begin());
    unknown_.push_back({participant, description_.session, misfit(domain)});
  }
  std::erase_if(unknown_, [&](Unknown& one) {
    const bool world = status_->is_program(ProgramKind::world_sim, one.participant);
    if (world) accept(one.session, std::move(one.misfit));
    return world;
  });
  if (session_ == 0 && other_ && std::chrono::steady_clock::now() - *other_ > kMayBeEnding)
    throw Error(ExitCode::usage, misfit_);
  return session_ != 0;
}

}  // namespace subworld

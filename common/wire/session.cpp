#include "wire/session.hpp"

#include "model/error.hpp"

#include <fmt/format.h>

#include <array>
#include <random>

namespace subworld {

namespace {

using namespace std::chrono_literals;

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

std::string gone_text(ProgramKind program, std::uint32_t instance) {
  return fmt::format("{} has died or is suspended: it sends no sign of life", label_of(program, instance));
}

std::string replaced_text(ProgramKind program, std::uint32_t instance) {
  return fmt::format(
      "{} was started again, or two of them are on this domain: its messages belong to another run or to another "
      "program; restart all programs of the run, or give one of the two another --domain",
      label_of(program, instance));
}

bool SessionFinder::look(const std::string& scene_file, int domain) {
  while (scene_->take(description_) == Take::sample) {
    if (description_.settings_hash == settings_hash_) {
      session_ = description_.session;
    } else if (!other_) {
      other_ = std::chrono::steady_clock::now();
    }
  }
  if (session_ == 0 && other_ && std::chrono::steady_clock::now() - *other_ > kMayBeEnding) {
    throw Error(ExitCode::usage,
                fmt::format("{}: the world on domain {} runs scene \"{}\" with other settings; give all programs the "
                            "same file and the same flags",
                            scene_file, domain, description_.name));
  }
  return session_ != 0;
}

}  // namespace subworld

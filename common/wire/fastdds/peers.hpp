#pragma once

#include "wire/backend.hpp"
#include "wire/fastdds/vendor.hpp"

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <utility>

namespace subworld::wire::fast {

/// The programs of other participants, as discovery describes them.
class FastPeers final : public ParticipantListener {
 public:
  explicit FastPeers(EventSink& events) : events_(events) {}
  /// Whether another program has taken over the UDP port of this participant. Then its program is dead, also where the
  /// lease has not expired. Fast DDS 2.9 renews the leases of all writers whenever any participant renews its own.
  [[nodiscard]] bool replaced(std::uint64_t participant) const noexcept {
    const std::lock_guard lock(mutex_);
    return replaced_.contains(participant);
  }
  /// Its program, also after it has gone.
  [[nodiscard]] std::optional<PeerProgram> program(std::uint64_t participant) const {
    const std::lock_guard lock(mutex_);
    const auto found = programs_.find(participant);
    if (found == programs_.end()) return {};
    return found->second;
  }
  /// Changes with each participant that is replaced.
  [[nodiscard]] std::uint64_t replacements() const noexcept { return replacements_; }

 private:
  void onParticipantAuthentication(dds::DomainParticipant*, rtps::ParticipantAuthenticationInfo&& info) override {
    if (info.status == rtps::ParticipantAuthenticationInfo::UNAUTHORIZED_PARTICIPANT)
      events_.report(Event::refused, 1, kParticipant, kParticipant, "");
  }
  void on_participant_discovery(dds::DomainParticipant*, ParticipantDiscoveryStatus reason,
                                const ParticipantBuiltinTopicData& info, bool&) override {
    const std::uint64_t participant = number_of(info.guid.guidPrefix);
    const std::lock_guard lock(mutex_);
    if (reason == ParticipantDiscoveryStatus::REMOVED_PARTICIPANT ||
        reason == ParticipantDiscoveryStatus::DROPPED_PARTICIPANT) {
      replaced_.erase(participant);
      std::erase_if(owners_, [&](const auto& one) { return one.second == participant; });
      return;
    }
    if (programs_.size() < kMostPrograms) programs_.try_emplace(participant, describe(info));
    for (const rtps::Locator_t& port : info.metatraffic_locators.unicast) {
      const auto [owner, is_new] = owners_.try_emplace(port, participant);
      if (is_new || owner->second == participant) continue;
      replaced_.insert(std::exchange(owner->second, participant));
      ++replacements_;
    }
  }

  static PeerProgram describe(const ParticipantBuiltinTopicData& data) {
    return describe_peer(data.participant_name.to_string(), [&](const char* name) {
      std::string value;
      for (const auto& property : data.properties)
        if (property.first() == name) value = property.second();
      return value;
    });
  }

  EventSink& events_;
  static constexpr std::size_t kMostPrograms = 1024;
  mutable std::mutex mutex_;
  std::map<std::uint64_t, PeerProgram> programs_;
  std::map<rtps::Locator_t, std::uint64_t> owners_;
  std::set<std::uint64_t> replaced_;
  std::atomic<std::uint64_t> replacements_ = 0;
};

}  // namespace subworld::wire::fast

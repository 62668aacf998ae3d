#pragma once

#include "model/hash.hpp"
#include "wire/backend.hpp"
#include "wire/cyclonedds/vendor.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

namespace subworld::wire::cyclone {

/// What discovery says of writers and their participants, also after they have gone.
class CyclonePeers {
 public:
  void open(dds_entity_t participant) {
    publications_ = require(dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr),
                            "reader of publications");
    participants_ = require(dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, nullptr, nullptr),
                            "reader of participants");
  }

  /// 0: not known.
  [[nodiscard]] std::uint64_t participant_of(dds_instance_handle_t writer) const noexcept {
    std::uint64_t number = 0;
    look<dds_builtintopic_endpoint_t>(publications_, writer, [&](const auto& found) {
      number = kHashSeed;
      for (const std::uint8_t byte : found.participant_key.v) number = hashed(number, byte);
    });
    return number;
  }

  [[nodiscard]] std::optional<PeerProgram> program_of(dds_instance_handle_t writer) const {
    std::optional<PeerProgram> program;
    look<dds_builtintopic_endpoint_t>(publications_, writer, [&](const auto& of) {
      look<dds_builtintopic_participant_t>(participants_, of.participant_instance_handle,
                                           [&](const auto& found) { program = describe(found.qos); });
    });
    return program;
  }

 private:
  template <class T, class Use>
  static void look(dds_entity_t reader, dds_instance_handle_t instance, Use use) {
    void* sample = nullptr;
    dds_sample_info_t info;
    if (instance == 0 || dds_read_instance(reader, &sample, &info, 1, 1, instance) != 1) return;
    use(*static_cast<const T*>(sample));
    dds_return_loan(reader, &sample, 1);
  }

  static PeerProgram describe(const dds_qos_t* qos) {
    char* name = nullptr;
    std::string text;
    if (dds_qget_entity_name(qos, &name) && name != nullptr) text = name;
    dds_free(name);
    return describe_peer(std::move(text), [qos](const char* of) {
      char* value = nullptr;
      std::string found;
      if (dds_qget_prop(qos, of, &value) && value != nullptr) found = value;
      dds_free(value);
      return found;
    });
  }

  dds_entity_t publications_ = 0;
  dds_entity_t participants_ = 0;
};

}  // namespace subworld::wire::cyclone

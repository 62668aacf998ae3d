#pragma once

#include "wire/backend.hpp"
#include "wire/fastdds/vendor.hpp"

#include <fastdds/dds/topic/IContentFilter.hpp>
#include <fastdds/dds/topic/IContentFilterFactory.hpp>

#include <deque>
#include <string_view>

namespace subworld::wire::fast {

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wnon-virtual-dtor"  // of the vendor's interfaces
/// Refuses samples before they take room. Fast DDS 2.9 frees the room of a key only when all writers of the key are
/// gone, and accepts no new key once kMostKeys have room.
class KeyFilter final : public dds::IContentFilter {
 public:
  KeyFilter(const TopicSpec& topic, EventSink& events) : topic_(topic), events_(events) {}
  bool evaluate(const SerializedPayload& payload, const FilterSampleInfo&, const GUID_t&) const override {
    if (is_known_key(topic_, {payload.data, payload.length})) return true;
    events_.report(Event::rejected, 1, "reader", topic_.name, kUnknownKey);
    return false;
  }
  [[nodiscard]] const char* type() const noexcept { return topic_.type; }

 private:
  const TopicSpec topic_;
  EventSink& events_;
};

class KeyFilters final : public dds::IContentFilterFactory {
 public:
  static constexpr const char* kName = "subworld_known_keys";
  void add(const TopicSpec& topic, EventSink& events) { filters_.emplace_back(topic, events); }

 private:
  ReturnCode_t create_content_filter(const char*, const char* type, const dds::TopicDataType*, const char*,
                                     const ParameterSeq&, dds::IContentFilter*& filter) override {
    for (KeyFilter& one : filters_) {
      if (std::string_view(one.type()) == type) filter = &one;
    }
    return filter == nullptr ? kBadParameter : kOk;
  }
  ReturnCode_t delete_content_filter(const char*, dds::IContentFilter*) override { return kOk; }

  std::deque<KeyFilter> filters_;
};
#pragma GCC diagnostic pop

}  // namespace subworld::wire::fast

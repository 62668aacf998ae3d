#include "outbox.hpp"

namespace subworld::live {

bool Outbox::add_control(std::string text) {
  if (control_bytes_ + text.size() > limits_.control_bytes) return false;
  control_bytes_ += text.size();
  control_.push_back(std::move(text));
  return true;
}

void Outbox::add_data(std::uint32_t subscription, Sample sample) {
  const Key key{subscription, sample.key};
  if (const auto same = by_key_.find(key); same != by_key_.end()) {
    Sample& waiting = same->second->sample;
    data_bytes_ += sample.bytes->size() - waiting.bytes->size();
    waiting = std::move(sample);
    ++dropped_;
  } else {
    data_bytes_ += sample.bytes->size();
    data_.push_back({subscription, std::move(sample)});
    by_key_[key] = std::prev(data_.end());
  }
  while (data_bytes_ > limits_.data_bytes && data_.size() > 1) {
    erase(data_.begin());
    ++dropped_;
  }
}

void Outbox::forget(std::uint32_t subscription) {
  for (auto one = data_.begin(); one != data_.end();) {
    const auto at = one++;
    if (at->subscription == subscription) erase(at);
  }
}

std::optional<Outbox::Message> Outbox::take() {
  Message message;
  if (!control_.empty()) {
    message.text = std::move(control_.front());
    control_.pop_front();
    control_bytes_ -= message.text.size();
    return message;
  }
  if (data_.empty()) return std::nullopt;
  message.data = data_.front();
  erase(data_.begin());
  return message;
}

void Outbox::erase(std::list<Data>::iterator at) {
  data_bytes_ -= at->sample.bytes->size();
  by_key_.erase({at->subscription, at->sample.key});
  data_.erase(at);
}

}  // namespace subworld::live

#include "orders.hpp"

#include <exception>

namespace subworld::live {
namespace {

constexpr std::chrono::seconds kOffered{5};  // discovery takes less than a second

}  // namespace

std::string Orders::send(std::span<const std::uint8_t> cdr, Clock::time_point now) {
  Control order;
  if (!codec_.decode(cdr, order)) return "the order is no subworld::msg::Control";
  try {
    if (!writer_) writer_.emplace(bus_.writer<Control>());
  } catch (const std::exception& fault) {
    return fault.what();
  }
  until_ = now + kOffered;
  return writer_->write(order) ? std::string{} : "the middleware did not take the order; try again";
}

void Orders::inspect(Clock::time_point now) {
  if (writer_ && now > until_) writer_.reset();
}

}  // namespace subworld::live

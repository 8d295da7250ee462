// Our side of the exchange with another codec of MAVLink (check_mavlink.mjs).
//   mavlink_exchange write   a line of JSON for each of many messages: number, bytes in hexadecimal, fields by wire
//   order mavlink_exchange read    bytes in hexadecimal on a line of stdin; the same lines for what was in them
#include <cmath>
#include <cstring>
#include <iostream>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <type_traits>

#include "tileflight/core/base/random_numbers.h"
#include "tileflight/live/autopilot/mavlink.h"

namespace {

using namespace tileflight;
using namespace tileflight::autopilot;
using nlohmann::json;

constexpr int kOfEach = 100;

std::string hexadecimal(const std::string& bytes) {
  constexpr const char* kDigits = "0123456789abcdef";
  std::string text;
  for (const unsigned char c : bytes) {
    text += kDigits[c >> 4U];
    text += kDigits[c & 15U];
  }
  return text;
}

std::string bytes_of(const std::string& text) {
  std::string bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2)
    bytes += static_cast<char>(std::stoi(text.substr(i, 2), nullptr, 16));
  return bytes;
}

/// Any bits, but no number that is none; now and then zero, so that ends are cut.
template <class Number>
void fill(Number& number, base::SplitMix64& random) {
  const std::uint64_t bits = random.next();
  if (random.below(4) == 0) {
    number = 0;
  } else if constexpr (std::is_floating_point_v<Number>) {
    number = std::ldexp(static_cast<Number>(static_cast<std::int32_t>(bits)), static_cast<int>(bits >> 59U) - 40);
  } else {
    std::memcpy(&number, &bits, sizeof number);
  }
}

template <class Number, std::size_t N>
void fill(std::array<Number, N>& numbers, base::SplitMix64& random) {
  for (Number& one : numbers) fill(one, random);
}

/// 64-bit numbers as text: JSON's are doubles for many readers.
template <class Field>
json as_json(const Field& field) {
  if constexpr (std::is_same_v<Field, std::uint64_t>)
    return std::to_string(field);
  else
    return field;
}

template <class Message>
void print(const Message& message, const MavlinkFrame& frame) {
  json fields = json::array();
  Message::visit(message, [&](const auto& field) {
    const json value = as_json(field);
    if (value.is_array())
      fields.insert(fields.end(), value.begin(), value.end());
    else
      fields.push_back(value);
  });
  const json line = {{"number", Message::kMessage.number},
                     {"sequence", frame.sequence},
                     {"system", frame.system},
                     {"component", frame.component},
                     {"fields", fields},
                     {"bytes", hexadecimal(encode_frame(Message::kMessage, frame))}};
  std::cout << line.dump() << "\n";
}

template <class Message>
void write_some() {
  base::SplitMix64 random(Message::kMessage.number);
  for (int i = 0; i < kOfEach; ++i) {
    Message message;
    Message::visit(message, [&](auto& field) { fill(field, random); });
    if (i == 0) std::memset(static_cast<void*>(&message), 0, sizeof message);
    print(message, {static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(1 + i), 51, Message::kMessage.number,
                    encode_payload(message)});
  }
}

template <class Message>
void print_read(const MavlinkFrame& frame) {
  if (frame.message == Message::kMessage.number) print(decode_payload<Message>(frame.payload), frame);
}

void read_all() {
  MavlinkReader reader;
  std::string line;
  while (std::getline(std::cin, line)) {
    reader.push(bytes_of(line));
    while (const auto frame = reader.next()) {
      print_read<Heartbeat>(*frame);
      print_read<HilActuatorControls>(*frame);
      print_read<HilSensor>(*frame);
      print_read<HilGps>(*frame);
      print_read<HilStateQuaternion>(*frame);
      print_read<DistanceSensor>(*frame);
      print_read<HilOpticalFlow>(*frame);
      print_read<Odometry>(*frame);
    }
  }
}

}  // namespace

int main(int count, char** words) {
  if (count == 2 && std::string(words[1]) == "read") {
    read_all();
  } else {
    write_some<Heartbeat>();
    write_some<HilActuatorControls>();
    write_some<HilSensor>();
    write_some<HilGps>();
    write_some<HilStateQuaternion>();
    write_some<DistanceSensor>();
    write_some<HilOpticalFlow>();
    write_some<Odometry>();
  }
}

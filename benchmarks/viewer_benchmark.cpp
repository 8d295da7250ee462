// From a message's publication until a viewer on this machine has read the whole of it, by size: a JPEG of 640 x 480,
// its depth in floats. Floor: the same bytes copied once within the process.
#include <benchmark/benchmark.h>

#include <cstdint>
#include <string>
#include <thread>

#include "tileflight/live/foxglove/server.h"
#include "tileflight/live/foxglove/test_web_socket.h"

namespace {

using namespace tileflight::foxglove;

constexpr int kPose = 400, kJpeg = 80'000, kDepth = 640 * 480 * 4;

void BM_Delivery(benchmark::State& state) {
  Server server({});
  const ChannelId channel = server.add_channel({"/image", "cdr", "sensor_msgs/msg/Image", "ros2msg", "uint8[] data"});
  TestWebSocket viewer(server.port());
  viewer.send_text(R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":)" + std::to_string(channel) + "}]}");
  while (!server.is_subscribed(channel)) std::this_thread::yield();
  const std::string message(static_cast<std::size_t>(state.range(0)), 'x');
  std::uint64_t time_ns = 0;
  for (auto _ : state) {
    server.publish(channel, ++time_ns, message);
    benchmark::DoNotOptimize(viewer.read_data());
  }
  state.SetBytesProcessed(state.iterations() * state.range(0));
}
BENCHMARK(BM_Delivery)->Arg(kPose)->Arg(kJpeg)->Arg(kDepth)->UseRealTime()->Unit(benchmark::kMillisecond);

void BM_Copy(benchmark::State& state) {
  const std::string message(static_cast<std::size_t>(state.range(0)), 'x');
  for (auto _ : state) benchmark::DoNotOptimize(std::string(message));
}
BENCHMARK(BM_Copy)->Arg(kPose)->Arg(kJpeg)->Arg(kDepth)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace

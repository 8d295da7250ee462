#include "tileflight/live/ros2/received.h"

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>

#include <array>

namespace tileflight::ros2 {

void take_all(std::int32_t reader, const std::function<void(const RawMessage& message, std::uint64_t sender)>& handle) {
  constexpr std::uint32_t kAtOnce = 16;
  std::array<ddsi_serdata*, kAtOnce> taken{};
  std::array<dds_sample_info_t, kAtOnce> infos{};
  for (;;) {
    const dds_return_t count = dds_takecdr(reader, taken.data(), kAtOnce, infos.data(), DDS_ANY_STATE);
    for (std::size_t i = 0; static_cast<dds_return_t>(i) < count; ++i) {
      if (infos[i].valid_data) handle(raw_message(*taken[i]), infos[i].publication_handle);
      ddsi_serdata_unref(taken[i]);
      taken[i] = nullptr;
    }
    if (count < static_cast<dds_return_t>(kAtOnce)) return;
  }
}

}  // namespace tileflight::ros2

// Definition: https://github.com/ros2/rmw_dds_common, msg/ParticipantEntitiesInfo.msg, NodeEntitiesInfo.msg, Gid.msg.
#include "tileflight/live/ros2/discovery_info.h"

#include "tileflight/data/messages/cdr.h"

namespace tileflight::ros2 {
namespace {

using messages::CdrWriter;

/// The identifier's octets; the rest are zeros.
void put(CdrWriter& writer, Release release, const Guid& guid) {
  writer.array(guid);
  constexpr std::array<std::uint8_t, 8> kRest{};
  if (release == Release::kHumble) writer.array(kRest);
}

void put(CdrWriter& writer, Release release, const std::set<Guid>& guids) {
  writer.number(static_cast<std::uint32_t>(guids.size()));
  for (const Guid& guid : guids) put(writer, release, guid);
}

}  // namespace

std::string participant_entities_info(Release release, const Guid& participant, const NodeInfo& node) {
  CdrWriter writer;
  put(writer, release, participant);
  writer.number(std::uint32_t{1}).text(node.node_namespace).text(node.name);
  put(writer, release, node.readers);
  put(writer, release, node.writers);
  return writer.bytes();
}

}  // namespace tileflight::ros2

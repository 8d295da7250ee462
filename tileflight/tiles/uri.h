#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::tiles {

/// `reference` as it stands in the file `base`, made a URI of the same source (RFC 3986, section 5.2). A relative base
/// gives a relative URI; its leading ".." segments are kept, so that a source can see that it would leave the root.
/// Back slashes count as slashes, as browsers read them.
std::string resolve_uri(std::string_view base, std::string_view reference);

/// "https" of "https://host/a"; empty where the URI is relative or a path. In lower case.
std::string uri_scheme(std::string_view uri);

/// The path of a relative URI without query and fragment, percent escapes decoded. Throws InputError (broken
/// escape, a zero byte).
std::string uri_path(std::string_view uri);

/// "b3dm" of "a/b.B3DM?v=1": what follows the last point of the last segment, in lower case; empty where there is none.
std::string uri_ending(std::string_view uri);

bool is_data_uri(std::string_view uri);
/// Bytes of a "data:" URI, base64 or percent-encoded (RFC 2397). Throws InputError.
std::vector<std::byte> decode_data_uri(std::string_view uri, const std::string& name);

/// A URI as it can stand in a message: keys and tokens in it are hidden (url_secrets.h), a "data:" URI or a very long
/// one is cut short.
std::string uri_for_message(std::string_view uri);

}  // namespace tileflight::tiles

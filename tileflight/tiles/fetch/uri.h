#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::fetch {

/// Resolves `reference`, found in the file `base`, to a URI of the same source (RFC 3986, section 5.2). A relative base
/// gives a relative URI; its leading ".." segments are kept, so that a source can detect that it leaves the root.
/// Backslashes count as slashes, as in browsers.
std::string resolve_uri(std::string_view base, std::string_view reference);

/// Returns the scheme in lower case: "https" for "https://host/a". Empty if the URI is relative or a path.
std::string uri_scheme(std::string_view uri);

/// Returns the path of a relative URI without query and fragment, percent-decoded. Throws InputError for an invalid
/// escape or a zero byte.
std::string uri_path(std::string_view uri);

/// Returns the lower-case extension of the last segment: "b3dm" for "a/b.B3DM?v=1". Empty if there is none.
std::string uri_extension(std::string_view uri);

/// Returns whether a URI begins with "data:".
bool is_data_uri(std::string_view uri);
/// Decodes a "data:" URI, base64 or percent-encoded (RFC 2397). Throws InputError.
std::vector<std::byte> decode_data_uri(std::string_view uri, const std::string& name);

/// Returns a URI for messages: keys and tokens are hidden (url_secrets.h); a "data:" URI or a very long one is
/// shortened.
std::string uri_for_message(std::string_view uri);

}  // namespace tileflight::fetch

"""Names from before the engine; gone with this room."""

from tanteo.measurements import ContactPoints as Touches
from tanteo.measurements import FreeRays as FreePaths
from tanteo.measurements import as_contact_points as as_touches
from tanteo.measurements import as_free_rays as as_free_paths

__all__ = ["FreePaths", "Touches", "as_free_paths", "as_touches"]

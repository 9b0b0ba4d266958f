from . import html as html
from . import image_picture as image_picture
from . import live as live
from . import pictures as pictures
from . import text as text
from .image_picture import draw_sight as draw_sight

import bpy

class ImportHelper:
    filepath: str
    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]: ...

class ExportHelper:
    filepath: str
    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]: ...
